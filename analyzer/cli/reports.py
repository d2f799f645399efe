"""Where the reports of `tailbyte check` go: files, standard output, GitHub."""

from __future__ import annotations

import os
import shutil
import sys
from contextlib import ExitStack
from pathlib import PurePath
from typing import TYPE_CHECKING

from analyzer.cli import options, streams

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from analyzer.report.model import Report
    from analyzer.sinks.atomic import Target

_WIDTH, _WIDEST = 80, 120
_FORMS = ("junit", "html", "json", "markdown")
_SUFFIXES = {".html": "html", ".htm": "html", ".json": "json", ".xml": "junit", ".md": "markdown", ".txt": "text"}


def add(parser: argparse.ArgumentParser, letters: Sequence[str] = ("-o", "-w")) -> argparse._ArgumentGroup:
    """The reports that may be asked for; `letters` are those of one whose name says the format."""
    group = parser.add_argument_group("reports", "FILE - is standard output, and then the text is left out")
    group.add_argument("--junit", metavar="FILE", help="JUnit XML, for test reports of CI services")
    group.add_argument("--html", metavar="FILE", help="one page for a browser, without a network")
    group.add_argument("--json", metavar="FILE", help="everything, in a documented schema")
    group.add_argument("--markdown", metavar="FILE", help="for comments and job summaries")
    group.add_argument(
        *letters, dest="output", action="append", default=[], metavar="REPORT",
        help="a report in the format that the name says: .html .json .xml (JUnit) .md .txt; repeatable",
    )  # fmt: skip
    group.add_argument("--all", action="store_true", help="in the text: every finding, rule, node and setting")
    return group


def files(args: argparse.Namespace) -> Iterator[tuple[str, str]]:
    """Every report to write, as format and path. Raises `ValueError`."""
    found = [(form, getattr(args, form)) for form in _FORMS if getattr(args, form) is not None]
    for path in args.output:
        form = _SUFFIXES.get(PurePath(path).suffix.lower())
        if form is None:
            raise ValueError(f"-o {path}: the name says no format: {' '.join(_SUFFIXES)}")
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
    """Every file before the work begins: what cannot be written is known at once. Raises `TargetError`."""
    from analyzer.sinks.atomic import Target  # noqa: PLC0415

    found = []
    for form, path in files:
        own = stack.enter_context(ExitStack())
        found.append((form, own.enter_context(Target(path)), own))
    return found


def all_written(targets: Iterable[Opened], report: Report, *, everything: bool) -> bool:
    """Writes each report; whether all could be."""
    done = [written(form, report, target, own, everything=everything) for form, target, own in targets]
    return all(done)


def written(form: str, report: Report, target: Target, own: ExitStack, *, everything: bool) -> bool:
    """Whether a report could be written; the others, and the exit status, do not depend on it."""
    from analyzer.sinks.atomic import TargetError  # noqa: PLC0415

    try:
        with own.pop_all():
            target.file.write(_bytes(form, report, everything=everything))
    except TargetError as error:
        streams.complain(str(error))
        return False
    except BrokenPipeError:  # whoever reads has seen enough
        streams.forget(1)
    return True


def tell(args: argparse.Namespace, report: Report, *, silent: bool) -> None:
    """The text. A reader that has seen enough does not change the exit status."""
    if silent:
        return
    try:
        _show(args, report)
        sys.stdout.flush()
    except BrokenPipeError:
        streams.forget(1)


def tell_github(report: Report, *, aside: bool) -> bool:
    """Annotations in the log, which GitHub reads on both streams; whether the summary of the step could be written."""
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


def _show(args: argparse.Namespace, report: Report) -> None:
    from analyzer.cli.pager import paged  # noqa: PLC0415
    from analyzer.report.text import render  # noqa: PLC0415
    from analyzer.views.terminal import Palette  # noqa: PLC0415

    asked = sys.stdout.isatty() or os.environ.get("COLUMNS")
    width = min(shutil.get_terminal_size((_WIDTH, 0)).columns, _WIDEST) if asked else _WIDTH
    with paged(args) as out:
        out.write(render(report, width=width, everything=args.all, palette=Palette(options.colour(args))))


def _bytes(form: str, report: Report, *, everything: bool) -> bytes:
    from analyzer.report import html, json, junit, markdown, text  # noqa: PLC0415

    render: dict[str, Callable[[Report], str]] = {
        "html": html.render, "json": json.render, "junit": junit.render, "markdown": markdown.render,
        "text": lambda report: text.render(report, everything=everything, utc=True),
    }  # fmt: skip
    return render[form](report).encode("utf-8", "backslashreplace")
