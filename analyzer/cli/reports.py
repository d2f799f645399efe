"""Where the reports of `tailbyte check` go: files, standard output, GitHub."""

from __future__ import annotations

import os
import shutil
import sys
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

from analyzer.app.process import streams
from analyzer.cli.arguments import options
from analyzer.report.formats import FORMATS, by_suffix

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from analyzer.report.formats import ReportFormat
    from analyzer.report.model import Report
    from analyzer.sinks.atomic import Target

_WIDTH, _WIDEST = 80, 120


def add(
    parser: argparse.ArgumentParser, letters: Sequence[str] = ("-o", "-w"), forms: Sequence[ReportFormat] = FORMATS,
    everything: str = "every finding, rule, node and setting",
) -> argparse._ArgumentGroup:  # fmt: skip
    """Add the reports that may be asked for; `letters` are those of one whose name says the format.

    `everything` is what the text leaves out without `--all`.
    """
    group = parser.add_argument_group("reports", "FILE - is standard output, and then the text is left out")
    for form in filter(lambda form: form.help, forms):
        group.add_argument(f"--{form.name}", metavar="FILE", help=form.help)
    group.add_argument(
        *letters, dest="output", action="append", default=[], metavar="REPORT",
        help=f"a report in the format that the name says: {_suffixes(forms)}; repeatable",
    )  # fmt: skip
    group.add_argument("--all", action="store_true", help=f"in the text: {everything}")
    return group


def _suffixes(forms: Sequence[ReportFormat]) -> str:
    return " ".join(f"{form.suffixes[0]}{' (JUnit)' if form.name == 'junit' else ''}" for form in forms)


def files(args: argparse.Namespace, forms: Sequence[ReportFormat] = FORMATS) -> Iterator[tuple[str, str]]:
    """Yield every report to write, as format and path. Raises `ValueError`."""
    suffixes = by_suffix(forms)
    given = ((form.name, getattr(args, form.name)) for form in forms if form.help)
    found = [(form, path) for form, path in given if path is not None]
    for path in args.output:
        form = suffixes.get(PurePath(path).suffix.lower())
        if form is None:
            raise ValueError(f"-o {path}: the name says no format: {' '.join(suffixes)}")
        found.append((form, path))
    seen: set[str] = set()
    for form, path in found:
        if not path:
            raise ValueError(f"the {form} report has no name")
        place = path if path == "-" else os.path.realpath(path)
        if place in seen:
            raise ValueError(f"{'standard output' if path == '-' else path}: two reports cannot be one file")
        if not os.path.exists(path) or os.path.isfile(path):  # noqa: PTH110, PTH113 - devices take several
            seen.add(place)
        yield form, path


Opened = tuple[str, "Target", ExitStack]


def opened(files: Iterable[tuple[str, str]], stack: ExitStack) -> list[Opened]:
    """Open every file before the work begins: what cannot be written is known at once. Raises `TargetError`."""
    from analyzer.sinks.atomic import Target  # noqa: PLC0415

    found = []
    for form, path in files:
        own = stack.enter_context(ExitStack())
        found.append((form, own.enter_context(Target(path)), own))
    return found


def all_written(
    targets: Iterable[Opened], report: Any, *, everything: bool, forms: Sequence[ReportFormat] = FORMATS
) -> bool:
    """Write each report, or what else the formats show; return whether all could be."""
    by_name = {form.name: form for form in forms}
    done = [written(by_name[form], report, target, own, everything=everything) for form, target, own in targets]
    return all(done)


def written(form: ReportFormat, report: Any, target: Target, own: ExitStack, *, everything: bool) -> bool:
    """Write a report; return whether it could be: the others, and the exit status, do not depend on it."""
    from analyzer.sinks.atomic import TargetError  # noqa: PLC0415

    try:
        with own.pop_all():
            text = form.render(report, everything=everything)
            target.file.write(text.encode("utf-8", "backslashreplace"))
    except TargetError as error:
        streams.complain(str(error))
        return False
    except BrokenPipeError:  # whoever reads has seen enough
        streams.forget(1)
    return True


@dataclass(frozen=True, slots=True)
class TextOptions:
    """How the text of a report reaches a terminal: all of it, in colour, through the pager."""

    everything: bool
    colour: bool
    pager: bool


def show_options(args: argparse.Namespace) -> TextOptions:
    """Return how the text is asked for."""
    return TextOptions(args.all, options.colour(args), not args.no_pager)


def tell(report: Report, how: TextOptions) -> None:
    """Print the text. A reader that has seen enough does not change the exit status."""
    from analyzer.report.text import render  # noqa: PLC0415

    tell_text(lambda **shape: render(report, **shape), how)


def tell_text(render: Callable[..., str], how: TextOptions) -> None:
    """Print what `render` makes for the terminal's width and colours."""
    try:
        _show(render, how)
        sys.stdout.flush()
    except BrokenPipeError:
        streams.forget(1)


def tell_github(report: Report, *, aside: bool) -> bool:
    """Write annotations into the log, which GitHub reads on both streams.

    Returns whether the summary of the step could be written.
    """
    from analyzer.report.github import commands, summary  # noqa: PLC0415

    (streams.tell if aside else sys.stdout.write)(commands(report))
    path = os.environ.get("GITHUB_STEP_SUMMARY")
    if not path:
        return True
    try:
        with open(path, "a", encoding="utf-8", errors="backslashreplace") as file:  # noqa: PTH123 - a plain append
            file.write(summary(report))
    except OSError as error:
        streams.complain(f"GITHUB_STEP_SUMMARY {path}: {error.strerror or error}")
        return False
    return True


def _show(render: Callable[..., str], how: TextOptions) -> None:
    from analyzer.cli.pager import paged  # noqa: PLC0415
    from analyzer.views.terminal import Palette  # noqa: PLC0415

    asked = sys.stdout.isatty() or os.environ.get("COLUMNS")
    width = min(shutil.get_terminal_size((_WIDTH, 0)).columns, _WIDEST) if asked else _WIDTH
    with paged(wanted=how.pager) as out:
        out.write(render(width=width, everything=how.everything, palette=Palette(how.colour)))
