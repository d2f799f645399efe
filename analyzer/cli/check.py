"""`tailbyte check`: captures under all rules; the exit status is for machines, the text for people."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

from analyzer.app import extracting
from analyzer.app.process import streams
from analyzer.app.targets import refuse_input
from analyzer.cli import check_init, reports, status
from analyzer.cli.arguments import options, rules

if TYPE_CHECKING:
    from analyzer.app.criteria import Criteria
    from analyzer.app.filtered.findings import MatchingFindings
    from analyzer.app.request import Request
    from analyzer.app.run import Run
    from analyzer.facts.periods import Periods
    from analyzer.report.draft import JudgedCapture
    from analyzer.report.model import Report
    from analyzer.rules.named_frames import NamedFrames

NAME = "tailbyte check"
_EPILOG = """\
Several captures are judged one by one, each with findings of its own in one report; --same-bus, --bus or --offset
merges them into one first, as for the other commands.

A window is judged as a capture of its own, whose start was not seen; its frames keep their numbers in the file.

exit status: 0 clean, 1 findings at or above --fail-on or a vehicle unlike the expected one (--init: no healthy capture,
no file), 2 wrong usage, 3 a capture unreadable or damaged or output not writable, 4 nothing to judge, no selected rule
that could be judged, or less than the vehicle file requires, 130 interrupted. 1 wins over 4, 4 over 3. The report
always states damage."""


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = "%(prog)s [options] CAPTURE..."
    parser.description = __doc__
    parser.epilog = _EPILOG
    options.add_reader(parser)
    options.add_threads(parser)
    group = rules.add_rules(parser)
    group.add_argument(
        "--init",
        action="store_true",
        help="write a file for --vehicle from a healthy capture to -o FILE instead; "
        "a capture with findings at or above --fail-on, or errors of devices, is none: exit status 1, no file",
    )
    group.add_argument(
        "--force",
        action="store_true",
        help="--init writes over a file, and from any capture; --extract writes among the files of a folder",
    )
    group.add_argument("--bitrate", type=options.positive, metavar="BITS", help="of the bus, per second")
    group = reports.add(parser)
    group.add_argument(
        "--github", action="store_true", help="annotations for GitHub Actions, and the summary of the step"
    )
    group.add_argument(
        "--extract", metavar="DIR", help="the smallest capture that still shows it, of each finding, as candump text"
    )
    options.add_filter(parser)
    options.add_window(parser)
    options.add_output(parser)
    parser.set_defaults(run=run, follow=False)


class _UsageError(Exception):
    """Arguments that do not go together; `place` points into a filter."""

    place = ""


def run(args: argparse.Namespace) -> int:
    """Judge every capture, then write the reports: each is there whole or not at all."""
    from analyzer.app.process.start import plain_arrow  # noqa: PLC0415
    from analyzer.sinks.atomic import TargetError  # noqa: PLC0415
    from dissectors import DsdlError, ProfileError  # noqa: PLC0415

    plain_arrow()
    try:
        wanted = _Wanted(args)
        return wanted.initial() if wanted.init else wanted.check()
    except (_UsageError, ProfileError, DsdlError) as error:  # a folder's rules are read when they are needed
        return status.usage(error, NAME)
    except TargetError as error:
        return status.damaged(error)


class _Wanted:
    """The arguments, checked before anything is read. Raises `_UsageError`."""

    def __init__(self, args: argparse.Namespace) -> None:
        self.init, self._force, self._github, self._extract = args.init, args.force, args.github, args.extract
        try:
            asked = options.request(args, NAME)
            self.request: Request = replace(asked, rules=rules.choice(args))
            self.files = [("toml", check_init.target(args))] if args.init else list(reports.files(args))
            for _, path in self.files:
                refuse_input(asked.names, path)
            extracting.refuse(args.extract, asked.names, force=args.force)
            self._show = reports.show_options(args)
            self._criteria: Criteria = _criteria(self.request)
            self._chosen = self._filter()
        except LookupError as error:
            raise _UsageError(error.args[0]) from None
        except (argparse.ArgumentTypeError, OSError, ValueError) as error:  # ProfileError and DsdlError are ValueError
            raise _usage(error) from None

    def check(self) -> int:
        """Judge and report; return the exit status."""
        silent = any(path == "-" for _, path in self.files)
        with ExitStack() as stack:
            targets = reports.opened(self.files, stack)
            taken, interrupted = self._take_all()
            report = self._matching(self._criteria.report(taken, " ".join(self.request.window_words)))
            written = reports.all_written(targets, report, everything=self._show.everything)
        if not silent:
            reports.tell(report, self._show)
        rules.tell_gate(self.request.rules, report)
        if self._github:
            written = reports.tell_github(report, aside=silent) and written
        if interrupted:
            return status.INTERRUPTED
        if self._extract and not extracting.extract(report, self.request, self._criteria, self._extract):
            return status.DAMAGED  # whatever was found: who asks for the parts counts on them
        return status.of_report(report, complete=written)

    def _matching(self, report: Report) -> Report:
        """Return the report with the findings that the filter selects; verdicts and exit status are those of all."""
        if self._chosen is None:
            return report
        cut = self._chosen.cut(report)
        count = f"{len(cut.findings)} of {len(report.findings)} findings match"
        streams.tell(f"-- {count}; verdicts and exit status are those of all\n")
        return cut

    def initial(self) -> int:
        """Write a vehicle file instead of a report; return the exit status."""
        from analyzer.facts.periods import Periods  # noqa: PLC0415

        if len(self.request.each()) > 1:
            raise _UsageError("--init takes one capture, or several of one bus with --same-bus")
        periods = Periods()
        taken, interrupted = self._take_all(periods)
        ((_, path),) = self.files
        report = self._criteria.report(taken, " ".join(self.request.window_words))
        model = check_init.Model(report, taken[0], self._criteria.registry, periods)
        return check_init.write(path, model, force=self._force, interrupted=interrupted)

    def _filter(self) -> MatchingFindings | None:
        """Return what holds findings to the filter, None without one. Raises what is wrong with it."""
        if self.request.filter is None:
            return None
        if self.init:
            raise _UsageError("-Y chooses findings: not with --init")
        from analyzer.app.filtered.findings import MatchingFindings  # noqa: PLC0415 - few commands have a filter
        from analyzer.filter.compiled import compile_filter  # noqa: PLC0415

        compile_filter(self.request.filter, self._criteria.registry)  # what is wrong is told before anything is read
        return MatchingFindings()

    def _named(self, run: Run, label: str) -> tuple[NamedFrames | None, dict[str, int]]:
        return (None, {}) if self._chosen is None else self._chosen.judging(run, label)

    def _take_all(self, periods: Periods | None = None) -> tuple[list[JudgedCapture], bool]:
        """Judge one capture after the other; say whether somebody has ended that."""
        from analyzer.app.process.start import return_freed  # noqa: PLC0415

        taken: list[JudgedCapture] = []
        for label, request in self.request.each().items():
            one, stopped = self._take(request, label, periods)
            taken.append(one)
            return_freed()  # a report needs none of what the rules have needed
            if stopped:
                return taken, True
        return taken, False

    def _take(self, request: Request, label: str, periods: Periods | None) -> tuple[JudgedCapture, bool]:
        """Judge one capture, or several as one; say whether somebody has ended that.

        Complaints have been made when this is back.
        """
        from analyzer.app.judged import JudgedRun  # noqa: PLC0415
        from analyzer.app.triage import RunTriage  # noqa: PLC0415
        from analyzer.cli.complaints import Complaints  # noqa: PLC0415
        from analyzer.cli.reading import reading, watched  # noqa: PLC0415

        complaints = Complaints()
        with reading(request, complaints, self._criteria.registry) as run:
            named, indexes = self._named(run, label)
            judged = JudgedRun(run, self._criteria, named)
            looked = RunTriage(run, drawn=any(form == "html" for form, _ in self.files))
            decoded = looked.over(run.inside() if periods is None else periods.over(run.inside()))
            with watched(run.source, complaints) as progress:
                for _ in progress.over(judged.batches(decoded)):
                    del _  # it is large
            indexes |= {name: index for index, name in enumerate(run.engine.buses)}
        if run.state == "refused":
            raise SystemExit(status.USAGE)
        run.go_on()
        return judged.taken(label, triage=looked.found()), run.stopped


def _usage(error: Exception) -> _UsageError:
    place = getattr(error, "place", "")
    made = _UsageError(error.args[0] if place else str(error))
    made.place = place
    return made


def _criteria(request: Request) -> Criteria:
    import dissectors  # noqa: PLC0415

    return rules.criteria(request.rules, dissectors.load(request.dissectors, request.trusted), NAME)
