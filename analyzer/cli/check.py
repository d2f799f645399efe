"""`tailbyte check`: captures under all rules; the exit status is for machines, the text for people."""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from contextlib import ExitStack
from pathlib import PurePath
from typing import TYPE_CHECKING

from analyzer.cli import DAMAGED, INTERRUPTED, OK, USAGE, options, streams

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from analyzer.cli.session import Session
    from analyzer.conformance import Choice
    from analyzer.engine import Batch
    from analyzer.report.build import Order, Taken
    from analyzer.report.model import Report
    from analyzer.rules.catalogue import Page
    from analyzer.rules.gate import FailOn
    from analyzer.rules.settings import Settings
    from analyzer.sinks.atomic import Target
    from dissectors import Registry

_WIDTH, _WIDEST = 80, 120
_FORMS = ("junit", "html", "json", "markdown")
_SUFFIXES = {".html": "html", ".htm": "html", ".json": "json", ".xml": "junit", ".md": "markdown", ".txt": "text"}
_EPILOG = """\
Several captures are judged one by one, each with findings of its own in one report; --same-bus, --bus or --offset
merges them into one first, as for the other commands.

exit status: 0 clean, 1 findings at or above --fail-on, 2 wrong usage, 3 a capture unreadable or damaged or output not
writable, 4 nothing to judge, 130 interrupted. 1 wins over 4, 4 over 3. The report always states damage."""


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command and its options."""
    parser = commands.add_parser(
        "check",
        help="judge captures by all rules of the protocol",
        description=__doc__,
        usage="%(prog)s [options] CAPTURE...",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    options.add_reader(parser)
    _add_rules(parser)
    group = parser.add_argument_group("reports", "FILE - is standard output, and then the text is left out")
    group.add_argument("--junit", metavar="FILE", help="JUnit XML, for test reports of CI services")
    group.add_argument("--html", metavar="FILE", help="one page for a browser, without a network")
    group.add_argument("--json", metavar="FILE", help="everything, in a documented schema")
    group.add_argument("--markdown", metavar="FILE", help="for comments and job summaries")
    group.add_argument(
        "--github", action="store_true", help="annotations for GitHub Actions, and the summary of the step"
    )
    group.add_argument(
        "-o", "-w", dest="output", action="append", default=[], metavar="REPORT",
        help="a report in the format that the name says: .html .json .xml (JUnit) .md .txt; repeatable",
    )  # fmt: skip
    group.add_argument("--all", action="store_true", help="in the text: every finding, rule, node and setting")
    options.add_output(parser)
    parser.set_defaults(run=run, follow=False)


def _add_rules(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("rules", "RULES: TRF-010, a layer (CAN, TRF, TYP, PUSH, BUS, CAP), or all")
    for name, text in (("select", "only these, also those that are off by default"), ("ignore", "all but these")):
        group.add_argument(
            f"--{name}", action="append", default=[], metavar="RULES", help=f"{text}; comma-separated, repeatable"
        )
    group.add_argument(
        "--origin", action="append", default=[], metavar="ORIGIN",
        help="only rules that these state: document, implied (by it), dronecan, heuristic",
    )  # fmt: skip
    group.add_argument(
        "--fail-on", action="append", default=[], metavar="CATEGORY:SEVERITY",
        help="what exit status 1 is for: protocol, device, capture or any; error, warning or note; comma-separated; "
        "or never (default: protocol:error)",
    )  # fmt: skip
    group.add_argument("--bitrate", type=options.positive, metavar="BITS", help="of the bus, per second")
    group.add_argument(
        "--dialect", action="append", default=[], type=options.dialect, metavar="NODE=CHOICE",
        help="how to read a node's doubtful fields, against its own data (24=tm, 24=dronecan, 24=K); repeatable",
    )  # fmt: skip


class _UsageError(Exception):
    """Arguments that do not go together."""


def run(args: argparse.Namespace) -> int:
    """Judges every capture, then writes the reports: each is there whole or not at all."""
    from analyzer.sinks.atomic import Target, TargetError  # noqa: PLC0415

    try:
        wanted = _Wanted(args)
        with ExitStack() as stack:
            targets = []
            for form, path in wanted.files:  # opened before the work: what cannot be written is known at once
                own = stack.enter_context(ExitStack())
                targets.append((form, own.enter_context(Target(path)), own))
            report, interrupted = wanted.judge()
            written = True
            for form, target, own in targets:
                written = _written(form, report, target, own, everything=args.all) and written
        _tell(args, report, silent=wanted.silent)
        if args.github:
            written = _tell_github(report, aside=wanted.silent) and written
    except _UsageError as error:
        streams.complain(str(error), "tailbyte check")
        return USAGE
    except TargetError as error:
        streams.complain(str(error))
        return DAMAGED
    if interrupted:
        return INTERRUPTED
    return report.gate.exit_status or (OK if written else DAMAGED)


def _written(form: str, report: Report, target: Target, own: ExitStack, *, everything: bool) -> bool:
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


class _Wanted:
    """The arguments, checked before anything is read. Raises `_UsageError`."""

    def __init__(self, args: argparse.Namespace) -> None:
        from analyzer.rules.gate import DEFAULT, FailOn  # noqa: PLC0415

        self._args = args
        try:
            self.names = options.captures(args)
            self.files = list(_files(args))
            for _, path in self.files:
                options.refuse_input(args, path)
            self._fail_on: FailOn = FailOn.parse(args.fail_on or [DEFAULT])
            self.registry: Registry = options.registry(args)
            self.pages: Mapping[str, Page] = _pages(self.registry)
            self.choice: Choice = _choice(args)
            self.settings: Settings = _settings(args, self.choice, self.pages)
        except LookupError as error:
            raise _UsageError(error.args[0]) from None
        except (argparse.ArgumentTypeError, OSError, ValueError) as error:  # ProfileError and DsdlError are ValueError
            raise _UsageError(str(error)) from None

    @property
    def silent(self) -> bool:
        """Whether standard output belongs to a report."""
        return any(path == "-" for _, path in self.files)

    def judge(self) -> tuple[Report, bool]:
        """The report, and whether the reading was interrupted."""
        from analyzer.conformance import ids  # noqa: PLC0415
        from analyzer.report.build import build  # noqa: PLC0415

        merge = bool(self._args.same_bus or self._args.bus or self._args.offset)
        groups = [self.names] if merge else [[name] for name in self.names]
        taken: list[Taken] = []
        interrupted = False
        for group, label in zip(groups, ids(groups), strict=True):
            one, interrupted = self._take(group, label)
            taken.append(one)
            if interrupted:
                break
        return build(taken, self.registry, self.pages, self.settings, self._order()), interrupted

    def _order(self) -> Order:
        from analyzer.conformance import tool  # noqa: PLC0415
        from analyzer.report.build import Order  # noqa: PLC0415

        asked: dict[str, object] = dict(self.choice.asked())
        if self._args.dialect:
            asked["dialects"] = [f"{node}={choice}" for node, choice in self._args.dialect]
        return Order(tool(), self._fail_on, asked)

    def _take(self, names: Sequence[str], label: str) -> tuple[Taken, bool]:
        """One capture, or several as one. Complaints have been made when this is back."""
        from analyzer.cli.session import Session  # noqa: PLC0415
        from analyzer.conformance import damage_of, reason_of  # noqa: PLC0415
        from analyzer.report.build import Taken  # noqa: PLC0415
        from analyzer.rules.checking import Check  # noqa: PLC0415
        from analyzer.sources import CaptureError  # noqa: PLC0415

        args = argparse.Namespace(**{**vars(self._args), "capture": list(names), "capture_": []})
        checking, unopened = Check(self.registry, self.settings), ""
        with Session(args) as session:
            for part in session.source.parts:
                part.hashed = True
            try:
                for batch in self._batches(session):
                    checking.feed(batch)
            except CaptureError as error:
                unopened = reason_of(error, names[0])
                raise
        if session.status == USAGE:
            raise SystemExit(USAGE)
        session.go_on()
        taken = Taken(
            id=label,
            path=names[0],
            checked=checking.finish(session.source.parts, session.engine),
            damage=unopened or damage_of(session.source, session.totals),
            unopened=bool(unopened),
            live=session.source.live,
            arguments=tuple(self._again(names)),
        )
        return taken, session.status == INTERRUPTED

    def _batches(self, session: Session) -> Iterator[Batch]:
        from analyzer.ahead import ahead  # noqa: PLC0415
        from analyzer.cli.progress import Progress  # noqa: PLC0415
        from analyzer.sources import StopReading  # noqa: PLC0415

        batches: Iterator[Batch] = session.batches()
        if all(os.path.isfile(part.name) for part in session.source.parts):  # noqa: PTH113 - signals end other reading here, in this thread
            batches = ahead(batches)
        with Progress(session.source) as progress:
            session.held = [] if progress.active else None
            try:
                yield from progress.over(batches)
            except StopReading:  # it was being opened
                raise KeyboardInterrupt from None
        session.release()

    def _again(self, names: Sequence[str]) -> Iterator[str]:
        """Arguments behind the first name that read all of it in the same way."""
        args = self._args
        yield from (f"./{name}" if name.startswith("-") and name != "-" else name for name in names[1:])
        if args.same_bus:
            yield "--same-bus"
        for option, given in (("--bus", args.bus), ("--offset", args.offset), ("--dissector", args.dissector)):
            for value in given:
                yield from (option, value)


def _pages(registry: Registry) -> Mapping[str, Page]:
    from analyzer.rules.catalogue import load  # noqa: PLC0415

    return load(registry)


def _choice(args: argparse.Namespace) -> Choice:
    from analyzer.conformance import Choice  # noqa: PLC0415

    return Choice(_words(args.select), _words(args.ignore), tuple(word.lower() for word in _words(args.origin)))


def _settings(args: argparse.Namespace, choice: Choice, pages: Mapping[str, Page]) -> Settings:
    from analyzer.rules.settings import Settings  # noqa: PLC0415

    dialects: dict[int, list[str]] = {}
    for node, reading in args.dialect:
        dialects.setdefault(node, []).append(reading)
    select, ignore = choice.rules(pages)
    return Settings(select=select, ignore=ignore, bit_rate=args.bitrate, dialects=dialects)


def _words(given: Iterable[str]) -> tuple[str, ...]:
    return tuple(word.strip() for text in given for word in text.split(",") if word.strip())


def _files(args: argparse.Namespace) -> Iterator[tuple[str, str]]:
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


def _bytes(form: str, report: Report, *, everything: bool) -> bytes:
    from analyzer.report import html, json, junit, markdown, text  # noqa: PLC0415

    render: dict[str, Callable[[Report], str]] = {
        "html": html.render, "json": json.render, "junit": junit.render, "markdown": markdown.render,
        "text": lambda report: text.render(report, everything=everything, utc=True),
    }  # fmt: skip
    return render[form](report).encode("utf-8", "backslashreplace")


def _tell(args: argparse.Namespace, report: Report, *, silent: bool) -> None:
    """The text. A reader that has seen enough does not change the exit status."""
    if silent:
        return
    try:
        _show(args, report)
        sys.stdout.flush()
    except BrokenPipeError:
        streams.forget(1)


def _show(args: argparse.Namespace, report: Report) -> None:
    from analyzer.cli.pager import paged  # noqa: PLC0415
    from analyzer.report.text import render  # noqa: PLC0415
    from analyzer.views.terminal import Palette  # noqa: PLC0415

    width = min(shutil.get_terminal_size().columns, _WIDEST) if sys.stdout.isatty() else _WIDTH
    with paged(args) as out:
        out.write(render(report, width=width, everything=args.all, palette=Palette(options.colour(args))))


def _tell_github(report: Report, *, aside: bool) -> bool:
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
