"""`tailbyte explain`: the page of a rule: what it checks, why that matters, an example, what to look at next."""

from __future__ import annotations

import shutil
import sys
from typing import TYPE_CHECKING

from analyzer.cli import options, status

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Iterator, Mapping

    from analyzer.rules.catalogue import Page
    from analyzer.views.terminal import Palette

NAME = "tailbyte explain"
_WIDTH = 80
_STYLES = {"error": "bad", "warning": "note", "note": "dim"}


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command and its options."""
    parser = commands.add_parser(
        "explain",
        help="what a rule of check means",
        description=__doc__,
        usage="%(prog)s [options] [RULE...]",
    )
    parser.add_argument("rule", nargs="*", metavar="RULE", help="TRF-010, or a layer: CAN, TRF, TYP, PUSH, BUS, CAP")
    parser.add_argument("--list", action="store_true", help="one line for each rule; of all rules if none is named")
    parser.add_argument("--markdown", action="store_true", help="one Markdown document; of all rules if none is named")
    options.add_dissectors(parser)
    options.add_output(parser)
    parser.set_defaults(run=run, follow=False)


def run(args: argparse.Namespace) -> int:
    """Print the pages that are asked for."""
    import dissectors  # noqa: PLC0415
    from analyzer.cli.pager import paged  # noqa: PLC0415
    from analyzer.report.explain import document, render  # noqa: PLC0415
    from analyzer.rules.catalogue import load, matching  # noqa: PLC0415
    from analyzer.views.terminal import Palette  # noqa: PLC0415
    from dissectors import DsdlError, ProfileError  # noqa: PLC0415

    if args.list and args.markdown:
        return status.usage("--list and --markdown: which one?", NAME)
    if not args.rule and not args.list and not args.markdown:
        return status.usage("which rule? --list names them all", NAME)
    try:
        pages = load(dissectors.load(*options.folders(args)))
        wanted = matching(_patterns(args.rule) or ["all"], pages)
    except (DsdlError, ProfileError, LookupError, OSError) as error:
        return status.usage(error, NAME)
    chosen = {rule: page for rule, page in pages.items() if rule in wanted}
    width = min(shutil.get_terminal_size().columns, 100) if sys.stdout.isatty() else _WIDTH
    palette = Palette(options.colour(args))
    with paged(wanted=not args.no_pager) as out:
        if args.markdown:
            out.write(document({rule: page.body for rule, page in chosen.items()}))
        elif args.list:
            out.writelines(_listed(chosen, width, palette))
        else:
            out.write("\n".join(render(rule, page.body, width=width, palette=palette) for rule, page in chosen.items()))
    return status.OK


def _patterns(given: Iterable[str]) -> list[str]:
    return [word for text in given for word in text.split(",") if word.strip()]


def _listed(pages: Mapping[str, Page], width: int, palette: Palette) -> Iterator[str]:
    from analyzer.views.terminal import fit  # noqa: PLC0415

    for rule, page in pages.items():
        severity = palette.paint(_STYLES[page.severity], f"{page.severity:<7}")
        off = "" if page.enabled else " (off)"
        start = f"{rule:<8}  {severity}  {page.category:<8}  "
        yield f"{start}{fit(page.title, width - 29 - len(off))}{off}\n"
