"""`tailbyte decode`: a capture as typed, CRC-checked transfers, one line each, or in full."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from analyzer.cli import USAGE, options, streams

if TYPE_CHECKING:
    from analyzer.cli.session import Session
    from analyzer.cli.writers import Writer
    from analyzer.window import Window

_FORMS = ("text", "fields", "json", "jsonl", "csv")
_TIMES = ("a", "ad", "d", "dd", "e", "r", "u", "ud")


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command and its options; letters mean what they mean to tshark."""
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
    """What a list says of each transfer."""
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
    """Reads the capture once, writes the chosen view, and accounts for every line on standard error."""
    try:
        check_view(args)
    except ValueError as error:
        return _usage(str(error))
    if args.follow and args.last is not None:
        return _usage("--last needs an end, --follow has none")
    from analyzer.cli.session import Session  # noqa: PLC0415
    from analyzer.cli.writers import writer  # noqa: PLC0415

    with Session(args) as session:
        try:
            window = options.window(args)
            writer(args, session.registry, None)  # names that do not exist are told before the capture is read
        except (argparse.ArgumentTypeError, LookupError, ValueError) as error:
            return _usage(str(error))
        if args.quiet:
            for _ in session.batches():
                pass
            session.account(None)
        else:
            _decode(args, session, window)
    return session.status


def check_view(args: argparse.Namespace) -> None:
    """Raises `ValueError` for what does not go together."""
    if bool(args.fields) != (args.form == "fields"):
        raise ValueError("-T fields and -e FIELD go together")


def _decode(args: argparse.Namespace, session: Session, window: Window) -> None:
    """Writes what the window lets through; stops early only when `-c` says so."""
    from analyzer.cli.pager import paged  # noqa: PLC0415
    from analyzer.cli.writers import writer  # noqa: PLC0415
    from analyzer.cut import ListSelection  # noqa: PLC0415

    selection = ListSelection(window, session.again)
    view: Writer | None = None
    shown = 0
    with paged(args) as out:
        session.held = None if out is sys.stdout else []
        for batch, rows, zero in selection.apply(session.batches()):
            if view is None:
                view = writer(args, session.registry, zero)
                out.write(view.begin())
            picked = rows if args.count is None else rows[: args.count - shown]
            for k, text in enumerate(session.unhurried(view.rows(batch, picked))):
                if shown == args.count:
                    break
                out.write(text)
                shown += k < len(picked)
            if args.follow:
                out.flush()
            if shown == args.count:
                break
        if view is not None:
            out.write(view.end())
    session.release()
    if selection.problem is not None:
        session.reject(selection.problem)
    if args.count is None or shown < args.count:
        session.account(shown)


def _usage(reason: str) -> int:
    streams.complain(reason, "tailbyte decode")
    return USAGE
