"""`tailbyte diff`: what is different between two captures, one that went well and one that did not."""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

from analyzer.app.targets import refuse_input
from analyzer.cli import reports, status
from analyzer.cli.arguments import options, rules
from analyzer.report.comparison.formats import FORMATS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.app.criteria import Criteria
    from analyzer.app.request import Request
    from analyzer.app.run import Run
    from analyzer.report.comparison.failing import DiffGate
    from analyzer.report.comparison.model import CaptureDiff
    from analyzer.report.comparison.traits import MeasuredSide

NAME = "tailbyte diff"
_SIDES = ("good", "bad")
_LIMITS = (("from", "start", "from this time on"), ("to", "stop", "up to this time"))
_EPILOG = """\
exit status: 0 done, 1 a difference that --fail-on names, 2 wrong usage, 3 a capture unreadable or damaged or output
not writable, 4 nothing to compare, 130 interrupted. 1 wins over 4, 4 over 3."""


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = "%(prog)s [options] GOOD BAD"
    parser.description = __doc__
    parser.epilog = _EPILOG
    parser.add_argument(
        "capture", nargs="*", metavar="GOOD BAD", help="two captures of any format; - is standard input"
    )
    parser.add_argument("-r", dest="capture_", action="append", default=[], metavar="CAPTURE", help="one, by letter")
    options.add_dissectors(parser)
    options.add_threads(parser)
    group = rules.add_choice(parser, "rules")
    group.add_argument(
        "--fail-on", dest="fails", action="append", default=[], metavar="WHAT",
        help="exit status 1 for: any difference, error, warning (or worse), note, a kind (node, exchange, hardware, "
        "firmware, reading, parameter, rate, loss, telemetry, finding, bus); comma-separated; never, the default",
    )  # fmt: skip
    group.add_argument("--bitrate", type=options.positive, metavar="BITS", help="of the bus, per second")
    reports.add(parser, forms=FORMATS, everything="every difference by itself, matched nodes and limits")
    options.add_filter(parser)
    options.add_window(parser)
    group = parser.add_argument_group("window of one capture", "TIME as above; beside a window of both")
    for side in _SIDES:
        for name, dest, text in _LIMITS:
            group.add_argument(f"--{side}-{name}", dest=f"{side}_{dest}", metavar="TIME", help=f"{side}: {text}")
    options.add_output(parser)
    parser.set_defaults(run=run, follow=False, bus=[], same_bus=False, offset=[])


class _UsageError(Exception):
    """Arguments that do not go together."""


def run(args: argparse.Namespace) -> int:
    """Read both captures, then write what differs: each report is there whole or not at all."""
    from analyzer.app.process.start import plain_arrow  # noqa: PLC0415
    from analyzer.filter.language.errors import FilterError  # noqa: PLC0415
    from analyzer.sinks.atomic import TargetError  # noqa: PLC0415
    from dissectors import DsdlError, ProfileError  # noqa: PLC0415

    plain_arrow()
    try:
        return _WantedDiff(args).compare()
    except (_UsageError, ProfileError, DsdlError) as error:  # a folder's rules are read when they are needed
        return status.usage(str(error), NAME)
    except FilterError as error:
        return status.usage(error, NAME)
    except TargetError as error:
        return status.damaged(error)


class _WantedDiff:
    """The arguments, checked before anything is read. Raises `_UsageError` and `FilterError`."""

    def __init__(self, args: argparse.Namespace) -> None:
        import dissectors  # noqa: PLC0415
        from analyzer.report.comparison.failing import DiffGate  # noqa: PLC0415

        try:
            names = _two(options.captures(args))
            self._sides = [_side(args, side, name) for side, name in zip(_SIDES, names, strict=True)]
            self._files = list(reports.files(args, FORMATS))
            for _, path in self._files:
                refuse_input(names, path)
            self._show = reports.show_options(args)
            self._gate: DiffGate = DiffGate.parse(args.fails)
            first = self._sides[0]
            registry = dissectors.load(first.dissectors, first.trusted)
            self._criteria: Criteria = rules.criteria(first.rules, registry, NAME)
        except LookupError as error:
            raise _UsageError(error.args[0]) from None
        except (argparse.ArgumentTypeError, OSError, ValueError) as error:  # ProfileError and DsdlError are ValueError
            raise _UsageError(str(error)) from None
        if first.filter is not None:  # what is wrong with it is told before anything is read
            from analyzer.filter.compiled import compile_filter  # noqa: PLC0415 - few comparisons have one

            compile_filter(first.filter, registry)

    def compare(self) -> int:
        """Compare and report; return the exit status."""
        from analyzer.app.diff import tool  # noqa: PLC0415
        from analyzer.report.comparison.compare import compare  # noqa: PLC0415

        silent = any(path == "-" for _, path in self._files)
        with ExitStack() as stack:
            targets = reports.opened(self._files, stack)
            (good, first), (bad, second) = self._take(self._sides[0]), self._take(self._sides[1])
            whole = first.state == second.state == "whole"
            found = compare(good, bad, self._gate, tool(), list(self._parts()))
            written = reports.all_written(targets, found, everything=self._show.everything, forms=FORMATS)
        if not silent:
            self._tell(found)
        return status.of_comparison(found, complete=written and whole)

    def _parts(self) -> Iterator[str]:
        """Yield what only a part of the captures is."""
        words = [" ".join(side.window_words) for side in self._sides]
        if words[0] == words[1]:
            yield from (f"only {text}" for text in words[:1] if text)
        else:
            yield from (f"{side}: only {text}" for side, text in zip(_SIDES, words, strict=True) if text)
        if self._sides[0].filter is not None:
            yield f"only what matches {self._sides[0].filter}"

    def _tell(self, found: CaptureDiff) -> None:
        from analyzer.report.comparison.text import HEIGHT, render  # noqa: PLC0415

        asked = sys.stdout.isatty() or os.environ.get("LINES")
        height = max(shutil.get_terminal_size((0, HEIGHT)).lines - 1, HEIGHT - 1) if asked else HEIGHT - 1
        reports.tell_text(lambda **shape: render(found, height=height, **shape), self._show)

    def _take(self, request: Request) -> tuple[MeasuredSide, Run]:
        """Measure one capture. Complaints have been made when this is back."""
        from analyzer.app.diff import finished, measured  # noqa: PLC0415
        from analyzer.app.judged import JudgedRun  # noqa: PLC0415
        from analyzer.cli.complaints import Complaints  # noqa: PLC0415
        from analyzer.cli.reading import reading, watched  # noqa: PLC0415
        from analyzer.report.comparison.traits import Traits  # noqa: PLC0415

        complaints, traits = Complaints(), Traits(self._criteria.registry, self._criteria.settings)
        with reading(request, complaints, self._criteria.registry) as run:
            options.choose(run)
            judged = JudgedRun(run, self._criteria)
            with watched(run.source, complaints) as progress:
                measured(judged, traits, progress.over)
        if run.state == "refused":
            raise SystemExit(status.USAGE)
        if run.stopped:  # half of a capture is no side of a comparison
            raise SystemExit(status.INTERRUPTED)
        return finished(judged, traits, self._criteria), run


def _two(names: list[str]) -> list[str]:
    if len(names) != len(_SIDES):
        raise ValueError(f"two captures are compared, not {len(names)}: what went well, and what did not")
    return names


def _side(args: argparse.Namespace, side: str, name: str) -> Request:
    """Return what is asked of one capture: the window of both, with its own limits where it has some."""
    own = {dest: getattr(args, f"{side}_{dest}") for _, dest, _ in _LIMITS}
    both = {dest: getattr(args, dest) for _, dest, _ in _LIMITS}
    limits = {dest: f"--{side}-{option}" for option, dest, _ in _LIMITS if own[dest] is not None}
    alone = argparse.Namespace(**{**vars(args), "capture": [name], "capture_": [], "limits": limits})
    for dest, text in own.items():
        setattr(alone, dest, both[dest] if text is None else text)
    return replace(options.request(alone, NAME), rules=rules.choice(args))
