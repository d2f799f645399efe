"""`tailbyte decode`: a capture as typed, CRC-checked transfers, one line each, or in full."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from analyzer.cli import options, status
from analyzer.views.formats import BY_NAME

if TYPE_CHECKING:
    from analyzer.app.run import Run
    from analyzer.cli.complaints import Complaints
    from analyzer.views.formats import Writer
    from analyzer.views.writers import WriterOptions

NAME = "tailbyte decode"
_FORMS = ("text", "fields", *BY_NAME)
_TIMES = ("a", "ad", "d", "dd", "e", "r", "u", "ud")


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command and its options; letters mean what they mean to tshark."""
    parser = commands.add_parser("decode", help="list or export the transfers of a capture", description=__doc__)
    options.add_reader(parser)
    show = parser.add_argument_group("what to show")
    show.add_argument("-c", dest="count", type=options.positive, metavar="N", help="stop after N transfers")
    add_view(show)
    show.add_argument("-q", dest="quiet", action="store_true", help="decode and check, but list nothing")
    show.add_argument("--follow", action="store_true", help="show at once what comes; wait at the end of a file")
    options.add_window(parser)
    options.add_output(parser)
    parser.set_defaults(run=run)


def add_view(show: argparse._ArgumentGroup) -> None:
    """Add what a list says of each transfer."""
    show.add_argument("-V", dest="details", action="store_true", help="details: every field down to its bits")
    show.add_argument("-O", dest="only", metavar="TYPE,...", help="details of these types only (implies -V)")
    show.add_argument("-P", dest="summary", action="store_true", help="the summary line too, with -V")
    show.add_argument("-x", dest="bytes", action="store_true", help="bytes: CRC, payload, padding and tail told apart")
    show.add_argument("-t", dest="time", choices=_TIMES, default="r", metavar="a|ad|d|dd|e|r|u|ud", help=_TIME_HELP)
    show.add_argument("-T", dest="form", choices=_FORMS, default="text", help="default: text")
    show.add_argument(
        "-e", dest="fields", action="append", default=[], metavar="FIELD", help="a field of -T fields; repeatable"
    )


_TIME_HELP = "time of day, with date, since previous, since shown, epoch, relative (default), UTC, UTC with date"


def run(args: argparse.Namespace) -> int:
    """Read the capture once, write the chosen view, and account for every line on standard error."""
    if args.follow and args.last is not None:
        return status.usage("--last needs an end, --follow has none", NAME)
    try:
        view = view_options(args)
        request = options.request(args)
    except (argparse.ArgumentTypeError, ValueError) as error:
        return status.usage(error, NAME)
    from analyzer.cli.complaints import Complaints  # noqa: PLC0415
    from analyzer.cli.reading import account, reading  # noqa: PLC0415
    from analyzer.views.writers import writer  # noqa: PLC0415

    complaints, pager = Complaints(), not (args.no_pager or args.follow)
    with reading(request, complaints) as run:
        try:
            writer(view, run.registry, None)  # names that do not exist are told before the capture is read
        except (LookupError, ValueError) as error:
            return status.usage(error, NAME)
        if args.quiet:
            for _ in run.batches():
                pass
            account(run, None)
        else:
            _decode(run, view, complaints, args.count, pager=pager)
    return status.of_run(run)


def view_options(args: argparse.Namespace) -> WriterOptions:
    """Return what is asked of the list. Raises `ValueError` for what does not go together."""
    from analyzer.views.writers import WriterOptions  # noqa: PLC0415

    if bool(args.fields) != (args.form == "fields"):
        raise ValueError("-T fields and -e FIELD go together")
    return WriterOptions(
        form=args.form,
        fields=tuple(args.fields),
        time=args.time,
        details=args.details,
        only=None if args.only is None else tuple(name for name in args.only.split(",") if name),
        summary=args.summary,
        dumps=args.bytes,
        signed=args.around is not None,
        colour=options.colour(args),
    )


def _decode(run: Run, options: WriterOptions, complaints: Complaints, count: int | None, *, pager: bool) -> None:
    """Write what the window lets through; stop early only when `count` transfers are shown."""
    from analyzer.cli.pager import paged  # noqa: PLC0415
    from analyzer.cli.reading import account  # noqa: PLC0415
    from analyzer.views.writers import writer  # noqa: PLC0415
    from analyzer.window.cut import ListSelection  # noqa: PLC0415

    selection = ListSelection(run.request.window, run.again)
    view: Writer | None = None
    shown = 0
    with paged(wanted=pager) as out:
        complaints.hold(out is not sys.stdout)
        for batch, rows, zero in selection.apply(run.batches()):
            if view is None:
                view = writer(options, run.registry, zero)
                out.write(view.begin())
            picked = rows if count is None else rows[: count - shown]
            for k, text in enumerate(run.unhurried(view.rows(batch, picked))):
                if shown == count:
                    break
                out.write(text)
                shown += k < len(picked)
            if run.request.follow:
                out.flush()
            if shown == count:
                break
        if view is not None:
            out.write(view.end())
    complaints.release()
    if selection.problem is not None:
        run.reject(selection.problem)
    if count is None or shown < count:
        account(run, shown)
