"""`tailbyte decode`: a capture as typed, CRC-checked transfers, one line each, or in full."""

from __future__ import annotations

import argparse
import shutil
import sys
from typing import TYPE_CHECKING

from analyzer.cli import options, status
from analyzer.views.formats import BY_NAME

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.app.run import Run
    from analyzer.cli.complaints import Complaints
    from analyzer.rules.named_frames import NamedFrames
    from analyzer.views.formats import Writer
    from analyzer.views.writers import WriterOptions
    from analyzer.window.listed import ListSelection
    from analyzer.window.screen import Item

NAME = "tailbyte decode"
_FORMS = ("text", "fields", *BY_NAME)
_NOT_ROWS = 4  # lines of a screen: the header, the middle, the account, the prompt
_TIMES = ("a", "ad", "d", "dd", "e", "r", "u", "ud")


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options; letters mean what they mean to tshark."""
    parser.description = __doc__
    options.add_reader(parser)
    options.add_threads(parser)
    show = parser.add_argument_group("what to show")
    show.add_argument(
        "-c", dest="count", type=options.positive, metavar="N", help="stop after N transfers, or frames of --frame-list"
    )
    add_view(show)
    show.add_argument("--frame-list", action="store_true", help="one row a frame: its verdict and its transfer")
    show.add_argument(
        "--number", choices=("capture", "wireshark"), default="capture",
        help="frame numbers of the capture (default), or Wireshark's, which counts error frames; the window's, too",
    )  # fmt: skip
    show.add_argument(
        "--findings", action="store_true", help="mark rows with the rules that name them; reads the capture twice"
    )
    show.add_argument("-q", dest="quiet", action="store_true", help="decode and check, but list nothing")
    show.add_argument("--follow", action="store_true", help="show at once what comes; wait at the end of a file")
    options.add_dialect(parser)
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
    show.add_argument("--derived", action="store_true", help="units and derived values, in -T jsonl, json and csv")
    show.add_argument("--foreign", action="store_true", help="list each frame that is not DroneCAN, not sums of them")
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
    from analyzer.facts.dialects import checked  # noqa: PLC0415
    from analyzer.views.writers import writer  # noqa: PLC0415

    complaints, pager = Complaints(), not (args.no_pager or args.follow)
    with reading(request, complaints) as run:
        try:
            checked(request.rules.readings(), run.registry)
            writer(view, run.registry, None)  # names that do not exist are told before the capture is read
        except (LookupError, ValueError) as error:
            return status.usage(error, NAME)
        if args.quiet:
            for _ in run.ahead(run.batches()):
                pass
            account(run, None)
        else:
            _decode(run, view, complaints, _screen(args), pager=pager, marked=args.findings)
    return status.of_run(run)


def view_options(args: argparse.Namespace) -> WriterOptions:
    """Return what is asked of the list. Raises `ValueError` for what does not go together."""
    from analyzer.views.writers import WriterOptions  # noqa: PLC0415

    if getattr(args, "findings", False) and (args.follow or args.quiet or args.form == "fields"):
        raise ValueError("--findings marks rows of a list, of json, jsonl or csv: not with --follow, -q or -T fields")
    if getattr(args, "frame_list", False) and (args.details or args.only is not None or args.summary or args.bytes):
        raise ValueError("--frame-list is a list of its own: -V, -O, -P and -x are about transfers")
    if args.derived and (args.form in ("text", "fields") or getattr(args, "frame_list", False)):
        raise ValueError(
            "--derived is for -T jsonl, json and csv of transfers; -V and -T fields have derived values anyway"
        )
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
        foreign=args.foreign,
        frame_list=getattr(args, "frame_list", False),
        follow=getattr(args, "follow", False),
        wireshark=getattr(args, "number", None) == "wireshark",
        count=getattr(args, "count", None),
        derived=args.derived,
    )


def _screen(args: argparse.Namespace) -> int | None:
    """Return how many rows to show to each side of what `--around` names, None if the width was given."""
    if args.around is None or "±" in args.around or "+-" in args.around:
        return None
    lines = shutil.get_terminal_size().lines
    return max(1, (lines - _NOT_ROWS) // 2)


def _named(run: Run) -> NamedFrames:
    """Judge the capture of a run before it is listed. Raises `KeyboardInterrupt` if somebody has ended that."""
    from analyzer.app.naming import named_frames  # noqa: PLC0415 - a list needs no rules

    named = named_frames(run)
    if run.stopped:
        raise KeyboardInterrupt
    return named


def _rows(run: Run, view: WriterOptions, selection: ListSelection, screen: int | None) -> Iterator[Item]:
    """Return the batches with the rows to list."""
    from analyzer.window.screen import Screen  # noqa: PLC0415

    around, batches = run.request.window.around, run.batches()
    if view.count is None and screen is None:  # else reading ends with the last row that is shown, not behind it
        batches = run.ahead(batches)
    items = (selection.frames if view.frame_list else selection.picked)(batches)
    return items if screen is None or around is None else Screen(around, selection.numbering, screen).cut(items)


def _decode(
    run: Run, options: WriterOptions, complaints: Complaints, screen: int | None, *, pager: bool, marked: bool
) -> None:
    """Write what the window lets through; stop early only when as many as asked for are shown."""
    from analyzer.cli.pager import paged  # noqa: PLC0415
    from analyzer.cli.reading import account  # noqa: PLC0415
    from analyzer.views.writers import writer  # noqa: PLC0415
    from analyzer.window.listed import ListSelection  # noqa: PLC0415
    from analyzer.window.numbering import Numbering  # noqa: PLC0415

    named = _named(run) if marked else None
    selection = ListSelection(run.request.window, run.again, Numbering(wireshark=options.wireshark))
    view: Writer | None = None
    shown, count = 0, options.count
    with paged(wanted=pager) as out:
        complaints.hold(out is not sys.stdout)
        for batch, rows, zero in _rows(run, options, selection, screen):
            if view is None:
                view = writer(options, run.registry, zero, selection.numbering, named)
                out.write(view.begin())
            picked = rows if count is None else rows._replace(transfers=rows.transfers[: count - shown])
            for k, text in enumerate(run.unhurried(view.rows(batch, picked))):
                if shown == count:
                    break
                out.write(text)
                shown += options.frame_list or k < len(picked.transfers)
            if options.follow:
                out.flush()
            if shown == count:
                break
        if view is not None:
            out.write(view.end())
    complaints.release()
    if selection.problem is not None:
        run.reject(selection.problem)
    if count is None or shown < count:
        account(run, shown, of="frames" if options.frame_list else "transfers")
