"""`tailbyte stats`: counts, rates, periods and loads of a capture as tables."""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

from analyzer.cli import status
from analyzer.cli.arguments import options
from analyzer.stats.catalogue import STATISTICS, named

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.app.run import Run
    from analyzer.app.statistics import RunStatistics

NAME = "tailbyte stats"
FORMS = ("text", "json", "csv")


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.description = __doc__
    width = max(map(len, STATISTICS)) + 2
    names = "\n".join(f"  {name:<{width}}{about}" for name, about in STATISTICS.items())
    parser.epilog = f"statistics:\n{names}"
    parser.usage = "tailbyte stats [options] NAME[,ARGS] [-z NAME[,ARGS]] CAPTURE..."
    parser.add_argument("name", nargs="?", action=_Statistic, metavar="NAME[,ARGS]", help="a statistic, see below")
    options.add_reader(parser)
    options.add_threads(parser)
    add_statistics(parser)
    parser.add_argument("--bitrate", type=options.positive, metavar="BITS", help="of the bus; default: 1000000")
    parser.add_argument("-T", dest="form", choices=FORMS, default="text", help="default: text")
    options.add_dialect(parser)
    options.add_filter(parser)
    options.add_window(parser)
    options.add_output(parser)
    parser.set_defaults(run=run)


class _Statistic(argparse.Action):
    """Takes the statistic that stands first; a capture, if statistics are given by letter."""

    def __call__(
        self, _: argparse.ArgumentParser, namespace: argparse.Namespace, values: object, __: str | None = None
    ) -> None:
        """Check it."""
        if values is None:
            if not namespace.statistics:
                raise argparse.ArgumentError(self, f"which statistic? one of {', '.join(STATISTICS)}")
            return
        text = str(values)
        try:
            namespace.name = statistic(text)
        except argparse.ArgumentTypeError as error:
            named = text == "-" or any(sign in text for sign in "./") or os.path.lexists(text)
            if not (namespace.statistics and named):
                raise argparse.ArgumentError(self, str(error)) from None
            namespace.capture_ = [text, *namespace.capture_]


def statistic(text: str) -> str:
    """Return `NAME[,ARGS]` if there is such a statistic. Raises `argparse.ArgumentTypeError`."""
    try:
        named(text)
    except ValueError as error:
        reason = str(error)
        if os.path.lexists(text) or text == "-":
            reason = f"{text!r} is a capture: a statistic stands before it (one of: {', '.join(STATISTICS)})"
        raise argparse.ArgumentTypeError(reason) from None
    return text


def add_statistics(parser: argparse._ActionsContainer) -> None:
    """Add the choice of statistics by letter."""
    parser.add_argument(
        "-z", dest="statistics", action="append", default=[], type=statistic, metavar="NAME[,ARGS]",
        help=f"a statistic: {', '.join(STATISTICS)}; repeatable, all in one reading",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Read the capture once and print what was asked for."""
    return read(args, [*([args.name] if args.name else []), *args.statistics], NAME)


def read(args: argparse.Namespace, texts: Sequence[str], who: str, *, mute: bool = False) -> int:
    """Read the capture once and print statistics; return the exit status. To be `mute` is to complain of nothing."""
    try:
        request = options.request(args)
    except (argparse.ArgumentTypeError, ValueError) as error:
        return status.usage(error, who)
    from analyzer.cli.complaints import Complaints  # noqa: PLC0415
    from analyzer.cli.reading import reading, watched  # noqa: PLC0415
    from analyzer.facts.dialects import checked  # noqa: PLC0415
    from analyzer.stats.intervals import TooManyIntervalsError  # noqa: PLC0415

    complaints = Complaints(mute=mute)
    with reading(request, complaints) as run:
        try:
            checked(request.rules.readings(), run.registry)
            found = made(run, texts, args)
        except (LookupError, OSError, ValueError) as error:
            return status.usage(error, who)
        try:
            with watched(run.source, complaints) as progress:
                for _ in progress.over(found.over(run.inside())):
                    pass
        except TooManyIntervalsError as error:
            return status.usage(error, who)
        if run.state == "refused":
            return status.USAGE
        if run.stopped:
            complaints("interrupted: the tables show what was read until then")
        found.conclude()
        show(run, found, args)
    return status.of_run(run)


def made(run: Run, texts: Sequence[str], args: argparse.Namespace) -> RunStatistics:
    """Return the statistics of a run that is not read yet. Raises what making them raises."""
    from analyzer.app.statistics import RunStatistics  # noqa: PLC0415

    return RunStatistics(run, texts, getattr(args, "bitrate", None))


@contextmanager
def behind(run: Run, found: RunStatistics | None, args: argparse.Namespace) -> Iterator[None]:
    """Write the tables behind what is written in the block, in which they are found, if there are to be any."""
    if found is None:
        yield
        return
    from analyzer.stats.intervals import TooManyIntervalsError  # noqa: PLC0415 - as above

    try:
        yield
    except TooManyIntervalsError as error:
        run.reject(str(error))
    if run.state != "refused":
        sys.stdout.write("\n")
        show(run, found, args)


def show(run: Run, found: RunStatistics, args: argparse.Namespace) -> None:
    """Write the tables."""
    from analyzer.cli.pager import paged  # noqa: PLC0415

    text = "".join(_texts(run, found, args))
    with paged(wanted=not args.no_pager) as out:
        out.write(text)


def _texts(run: Run, found: RunStatistics, args: argparse.Namespace) -> Iterator[str]:
    from analyzer.views.stats.machine import render_csv, render_json  # noqa: PLC0415
    from analyzer.views.stats.text import WIDTH, StatText  # noqa: PLC0415
    from analyzer.views.terminal import Palette  # noqa: PLC0415

    tables, head = found.tables(), found.head()
    if args.form == "json":
        yield render_json(head.plain(), tables)
    elif args.form == "csv":
        yield from render_csv([table for table in tables if table.main])
    else:
        width = max(WIDTH, shutil.get_terminal_size((WIDTH, 0)).columns if sys.stdout.isatty() else WIDTH)
        writer = StatText(width, found.start, found.end, Palette(options.colour(args)), timed=head.timed)
        yield from (f"{line}\n" for line in writer.head(head))
        for table in tables:
            yield "\n"
            yield from (f"{line}\n" for line in writer.table(table, buses=len(run.engine.buses)))
