"""`tailbyte explain`: what a rule checks, why that matters, an example, what to look at next; or what a word means."""

from __future__ import annotations

import re
import shutil
import sys
from typing import TYPE_CHECKING

from analyzer.cli import status
from analyzer.cli.arguments import options

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Iterator, Mapping

    from analyzer.rules.catalogue import Page
    from analyzer.views.terminal import Palette
    from dissectors import Registry

NAME = "tailbyte explain"
_WIDTH = 80
_RULE = re.compile(r"[A-Za-z]+-\d+")
_STYLES = {"error": "bad", "warning": "note", "note": "dim"}


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = "%(prog)s [options] [RULE|WORD...]"
    parser.description = __doc__
    parser.add_argument(
        "rule", nargs="*", metavar="RULE|WORD",
        help="TRF-010, or a layer: CAN, TRF, TYP, PUSH, BUS, CAP; or a clause (4.4.3), a type (NodeStatus, 341), "
        "a field (voltage), a word of the document (Oversupply); or a verdict of triage (wiring)",
    )  # fmt: skip
    parser.add_argument("--list", action="store_true", help="one line for each rule; of all rules if none is named")
    parser.add_argument("--markdown", action="store_true", help="one Markdown document; of all rules if none is named")
    parser.add_argument("--vehicle", metavar="FILE", help="rules of this vehicle file, too")
    options.add_dissectors(parser)
    options.add_output(parser)
    parser.set_defaults(run=run, follow=False)


def run(args: argparse.Namespace) -> int:
    """Print what is asked for."""
    import dissectors  # noqa: PLC0415
    from analyzer.cli.pager import paged  # noqa: PLC0415
    from analyzer.report.explain import document  # noqa: PLC0415
    from analyzer.rules.catalogue import load, matching  # noqa: PLC0415
    from analyzer.views.terminal import Palette  # noqa: PLC0415
    from dissectors import DsdlError, ProfileError  # noqa: PLC0415

    if args.list and args.markdown:
        return status.usage("--list and --markdown: which one?", NAME)
    words = _patterns(args.rule)
    if not words and not args.list and not args.markdown:
        return status.usage("which rule? --list names them all", NAME)
    width = min(shutil.get_terminal_size().columns, 100) if sys.stdout.isatty() else _WIDTH
    palette = Palette(options.colour(args))
    try:
        registry = dissectors.load(*options.folders(args))
        pages = _pages(load(registry), args.vehicle, registry)
        if not (args.list or args.markdown):
            text = _explained(words, " ".join(args.rule), registry, pages, width, palette)
        else:
            wanted = matching(words or ["all"], pages)
    except (DsdlError, ProfileError, LookupError, OSError) as error:
        return status.usage(error, NAME)
    with paged(wanted=not args.no_pager) as out:
        if not (args.list or args.markdown):
            out.write(text)
            return status.OK
        chosen = {rule: page for rule, page in pages.items() if rule in wanted}
        if args.markdown:
            out.write(document({rule: page.body for rule, page in chosen.items()}))
        else:
            out.writelines(_listed(chosen, width, palette))
    return status.OK


def _pages(pages: Mapping[str, Page], vehicle: str | None, registry: Registry) -> Mapping[str, Page]:
    """Return the pages with those of a vehicle file. Raises `ProfileError`."""
    if vehicle is None:
        return pages
    from pathlib import Path  # noqa: PLC0415 - only for this

    from analyzer.rules.vehicle.expected import load  # noqa: PLC0415

    own = load(Path(vehicle), pages, registry).own
    return pages if own is None else {**pages, **own.pages}


def _explained(
    words: list[str], phrase: str, registry: Registry, pages: Mapping[str, Page], width: int, palette: Palette
) -> str:
    """Return the pages of rules in their order, then those of other words. Raises `LookupError` with near names."""
    from analyzer.flight.verdict.pages import VERDICTS  # noqa: PLC0415
    from analyzer.report.explain import render  # noqa: PLC0415
    from analyzer.report.triage.explain import render as verdict  # noqa: PLC0415
    from analyzer.rules.catalogue import matching  # noqa: PLC0415

    rules, others, verdicts = set[str](), list[str](), list[str]()
    for word in words:
        if word.lower() in VERDICTS:
            verdicts.append(word.lower())
            continue
        try:
            rules |= matching([word], pages)
        except LookupError:
            if _RULE.fullmatch(word):
                raise
            others.append(word)
    texts = [verdict(kind, width=width, palette=palette) for kind in verdicts]
    texts += [render(rule, page.body, width=width, palette=palette) for rule, page in pages.items() if rule in rules]
    if others:
        from analyzer.report.topics.finding import Lexicon  # noqa: PLC0415 - a rule needs no types
        from analyzer.report.topics.page import Pages  # noqa: PLC0415

        lexicon = Lexicon(registry, pages)
        whole = lexicon.find(phrase) if len(words) > 1 else []
        texts, others = ([], [phrase]) if whole else (texts, others)  # the words belong together
        found = [lexicon.find(word) for word in others]
        for word, topics in zip(others, found, strict=True):
            if not topics:
                near = lexicon.near(phrase if len(others) == len(words) else word)
                hint = f"; did you mean {', '.join(near)}?" if near else ""
                raise LookupError(f"no rule, clause, type, field or word of the document is called {word[:40]!r}{hint}")
        writer = Pages(lexicon, registry, pages, width=width, palette=palette)
        texts += [writer.write(topics) for topics in found]
    return "\n".join(texts)


def _patterns(given: Iterable[str]) -> list[str]:
    return [word for text in given for word in text.split(",") if word.strip()]


def _listed(pages: Mapping[str, Page], width: int, palette: Palette) -> Iterator[str]:
    from analyzer.views.terminal import fit  # noqa: PLC0415

    for rule, page in pages.items():
        severity = palette.paint(_STYLES[page.severity], f"{page.severity:<7}")
        off = "" if page.enabled else " (off)"
        start = f"{rule:<8}  {severity}  {page.category:<8}  "
        yield f"{start}{fit(page.title, width - 29 - len(off))}{off}\n"
