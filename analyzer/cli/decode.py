"""`tailbyte decode`: a capture as typed, CRC-checked transfers, one line each, or in full."""

from __future__ import annotations

import argparse
import shutil
import sys
from typing import IO, TYPE_CHECKING

from analyzer.cli import stats, status
from analyzer.cli.arguments import options
from analyzer.views.formats import BY_NAME

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.app.filtered.run_filter import RunFilter
    from analyzer.app.request import Request
    from analyzer.app.run import Run
    from analyzer.app.statistics import RunStatistics
    from analyzer.cli.complaints import Complaints
    from analyzer.decode.engine import Batch
    from analyzer.rules.named_frames import NamedFrames
    from analyzer.views.formats import Writer
    from analyzer.views.options import WriterOptions
    from analyzer.window.listed import ListedRows, ListSelection
    from analyzer.window.numbering import Numbering
    from analyzer.window.screen import Item

NAME = "tailbyte decode"
_FORMS = ("text", "fields", *BY_NAME)
_NOT_ROWS = 4  # lines of a screen: the header, the middle, the account, the prompt
_TIMES = ("a", "ad", "d", "dd", "e", "r", "u", "ud")


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options; letters mean what they mean to tshark."""
    parser.usage = "%(prog)s [options] CAPTURE..."
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
    stats.add_statistics(show)
    options.add_dialect(parser)
    options.add_filter(parser)
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
        "--colours", "--colors", metavar="FILE",
        help="colour rules of rows, or `off`; default: yours (tailbyte help colours)",
    )  # fmt: skip
    show.add_argument("--derived", action="store_true", help="units and derived values, in -T jsonl, json and csv")
    show.add_argument("--foreign", action="store_true", help="list each frame that is not DroneCAN, not sums of them")
    show.add_argument(
        "-e",
        dest="fields",
        action="append",
        default=[],
        metavar="FIELD",
        help="a field of -T fields, csv, json; repeatable",
    )


_TIME_HELP = "time of day, with date, since previous, since shown, epoch, relative (default), UTC, UTC with date"


def run(args: argparse.Namespace) -> int:
    """Read the capture once, write the chosen view, and account for every line on standard error."""
    if args.follow and args.last is not None:
        return status.usage("--last needs an end, --follow has none", NAME)
    return _with_statistics(args) if args.statistics else _listed(args)


def _with_statistics(args: argparse.Namespace) -> int:
    """Write the list unless it is not wanted, and statistics behind it; return the exit status."""
    try:
        part = bool(options.window(args))
        _require_suited(args, part=part)
    except (argparse.ArgumentTypeError, ValueError) as error:
        return status.usage(error, NAME)
    if args.quiet:
        return stats.read(args, args.statistics, NAME)
    first = _listed(args, () if part else args.statistics)
    if not part or first not in (status.OK, status.DAMAGED):
        return first
    # A list shows transfers of the whole that reach into a window, statistics are of the window decoded by itself.
    sys.stdout.write("\n")
    return stats.read(args, args.statistics, NAME, mute=True)


def _require_suited(args: argparse.Namespace, *, part: bool) -> None:
    """Raise `ValueError` if statistics do not go with the list, which is of a part or of all."""
    if args.quiet and args.form not in stats.FORMS:
        raise ValueError(f"statistics have the forms {', '.join(stats.FORMS)}")
    if not args.quiet and (args.follow or args.form != "text"):
        raise ValueError("-z behind a list is text, and needs an end; with -q there is no list")
    if not args.quiet and part and "-" in (*args.capture, *args.capture_):
        raise ValueError("-z behind a list of a window reads the capture twice: no pipe; with -q there is no list")


def _listed(args: argparse.Namespace, texts: Sequence[str] = ()) -> int:
    """Write the list, and statistics behind it if there are any; return the exit status."""
    try:
        view = view_options(args)
        request = options.request(args)
        view = _with_comments(view, request)
    except (argparse.ArgumentTypeError, ValueError) as error:
        return status.usage(error, NAME)
    from analyzer.cli.complaints import Complaints  # noqa: PLC0415
    from analyzer.cli.reading import account, reading, watched  # noqa: PLC0415
    from analyzer.facts.dialects import checked  # noqa: PLC0415
    from analyzer.views.writers import writer  # noqa: PLC0415

    complaints, pager = Complaints(), not (args.no_pager or args.follow)
    with reading(request, complaints) as run:
        try:
            checked(request.rules.readings(), run.registry)
            writer(view, run.registry, None)  # names that do not exist are told before the capture is read
            chosen = _filter(run)
            found = stats.made(run, texts, args) if texts else None
        except (LookupError, OSError, ValueError) as error:
            return status.usage(error, NAME)
        if args.quiet and chosen is None:
            with watched(run.source, complaints) as progress:
                run.count(progress.step)
            account(run, None)
        else:
            marked, screen = args.findings, _screen(args)
            with stats.behind(run, found, args):
                _decode(run, view, complaints, screen, chosen, found, pager=pager, marked=marked, quiet=args.quiet)
    return status.of_run(run)


def view_options(args: argparse.Namespace) -> WriterOptions:
    """Return what is asked of the list. Raises `ValueError` for what does not go together."""
    from analyzer.views.options import WriterOptions  # noqa: PLC0415

    if getattr(args, "findings", False) and (args.follow or args.quiet or args.form == "fields"):
        raise ValueError("--findings marks rows of a list, of json, jsonl or csv: not with --follow, -q or -T fields")
    if getattr(args, "frame_list", False) and (args.details or args.only is not None or args.summary or args.bytes):
        raise ValueError("--frame-list is a list of its own: -V, -O, -P and -x are about transfers")
    if args.derived and (args.form in ("text", "fields") or getattr(args, "frame_list", False)):
        raise ValueError(
            "--derived is for -T jsonl, json and csv of transfers; -V and -T fields have derived values anyway"
        )
    if args.form == "fields" and not args.fields:
        raise ValueError("-T fields needs -e FIELD")
    if args.fields and args.form == "text":
        raise ValueError("-e FIELD goes with -T fields, csv, jsonl or json")
    if args.fields and (args.derived or getattr(args, "findings", False)):
        raise ValueError("-e FIELD says what is written: not with --derived or --findings")
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
        colours=args.colours,
        foreign=args.foreign,
        frame_list=getattr(args, "frame_list", False),
        follow=getattr(args, "follow", False),
        wireshark=getattr(args, "number", None) == "wireshark",
        count=getattr(args, "count", None),
        derived=args.derived,
    )


def _with_comments(view: WriterOptions, request: Request) -> WriterOptions:
    """Return the view with the comments that `tailbyte view` keeps beside the capture. Raises `MarksError`."""
    from analyzer.facts.frame_marks import comments_beside  # noqa: PLC0415
    from dissectors.records import replace  # noqa: PLC0415

    comments = comments_beside(request.names) if view.form == "text" else {}
    return replace(view, comments=comments) if comments else view


def _screen(args: argparse.Namespace) -> int | None:
    """Return how many rows to show to each side of what `--around` names, None if the width was given."""
    if args.around is None or "±" in args.around or "+-" in args.around:
        return None
    lines = shutil.get_terminal_size().lines
    return max(1, (lines - _NOT_ROWS) // 2)


def _filter(run: Run) -> RunFilter | None:
    """Return the filter that is asked for. Raises what is wrong with it, and with the labels that it needs."""
    if run.request.filter is None:
        return None
    from analyzer.app.filtered.run_filter import RunFilter  # noqa: PLC0415 - most lists have none

    return RunFilter(run)


def _named(run: Run, *, marked: bool) -> NamedFrames:
    """Judge the capture of a run before it is listed. Raises `KeyboardInterrupt` if somebody has ended that."""
    from analyzer.app.naming import named_frames  # noqa: PLC0415 - a list needs no rules

    named = named_frames(run, "--findings") if marked else named_frames(run)
    if run.stopped:
        raise KeyboardInterrupt
    return named


def _rows(
    run: Run, view: WriterOptions, selection: ListSelection, screen: int | None, chosen: RunFilter | None,
    found: RunStatistics | None, *, quiet: bool,
) -> Iterator[Item]:  # fmt: skip
    """Return the batches with the rows to list."""
    from analyzer.window.screen import Screen  # noqa: PLC0415

    around = run.request.window.around
    if chosen is not None and found is None and quiet and not (view.frame_list or run.request.window):
        chosen.only(run)
    elif chosen is not None and found is None:
        chosen.unpack(rows=not (quiet or view.frame_list), colours=view.colour and not quiet)
    batches = run.batches(early=view.count is not None or screen is not None)
    if found is not None:
        batches = found.over(batches)
    if chosen is not None and not view.frame_list:
        batches = chosen.over(batches)
    unlisted = quiet and screen is None
    items = (selection.frames if view.frame_list else selection.counted if unlisted else selection.picked)(batches)
    shown = items if screen is None or around is None else Screen(around, selection.numbering, screen).cut(items)
    return shown if chosen is None or view.frame_list else chosen.listed(shown)


def _decode(
    run: Run, options: WriterOptions, complaints: Complaints, screen: int | None, chosen: RunFilter | None,
    found: RunStatistics | None, *, pager: bool, marked: bool, quiet: bool,
) -> None:  # fmt: skip
    """Write what the window lets through; stop early only when as many as asked for are shown.

    Statistics are `found` in the same reading; they are of all, however many are shown.
    """
    from analyzer.cli.pager import paged  # noqa: PLC0415
    from analyzer.cli.progress import Progress, into_a_file  # noqa: PLC0415
    from analyzer.cli.reading import account  # noqa: PLC0415
    from analyzer.window.listed import ListSelection  # noqa: PLC0415
    from analyzer.window.numbering import Numbering  # noqa: PLC0415

    named = _named(run, marked=marked) if marked or (chosen is not None and chosen.judges) else None
    again = run.again if chosen is None or options.frame_list else chosen.again(run.again)
    if chosen is not None and named is not None:
        chosen.know(named)
    selection = ListSelection(run.request.window, again, Numbering(wireshark=options.wireshark))
    rows = _rows(run, options, selection, screen, chosen, found, quiet=quiet)
    wanted = (quiet or into_a_file(sys.stdout)) and not options.follow
    if quiet and chosen is not None:
        with Progress(run.source, wanted=wanted) as progress:
            complaints.hold(progress.active)
            shown = chosen.counted(progress.over(rows), selection.numbering)
    else:
        with paged(wanted=pager) as out, Progress(run.source, wanted=wanted) as progress:
            complaints.hold(out is not sys.stdout or progress.active)
            view = _View(run, options, selection.numbering, named if marked else None, chosen)
            items = progress.over(rows)
            shown = view.write(items, out)
        for _ in items if found is not None else ():
            pass
    complaints.release()
    if selection.problem is not None:
        run.reject(selection.problem)
    if chosen is not None:
        chosen.conclude()
    if options.count is None or shown < options.count:
        beside = (0, 0) if chosen is None or options.frame_list else (chosen.frames, chosen.errors)
        elsewhere = options.form != "text" and not quiet
        account(run, shown, frames=options.frame_list, match=chosen is not None, beside=beside, elsewhere=elsewhere)


class _View:
    """The writer that is asked for, made when the first batch is there."""

    def __init__(
        self, run: Run, options: WriterOptions, numbering: Numbering, named: NamedFrames | None,
        chosen: RunFilter | None,
    ) -> None:  # fmt: skip
        self._run, self._options, self._numbering, self._named, self._chosen = run, options, numbering, named, chosen
        self._shown = 0

    def write(self, items: Iterator[Item], out: IO[str]) -> int:
        """Write what is listed, and return how many transfers or frames that were."""
        from analyzer.views.writers import writer  # noqa: PLC0415

        run, options, view = self._run, self._options, None
        for batch, rows, zero in items:
            if view is None:
                matcher = None if self._chosen is None else self._chosen.frame_matcher()
                view = writer(options, run.registry, zero, self._numbering, self._named, matcher)
                out.write(view.begin())
            self._write(view, batch, rows, out)
            if options.follow:
                out.flush()
            if self._shown == options.count:
                break
        if view is not None:
            out.write(view.end())
            self._shown += self._waited(view)
        return self._shown

    def _waited(self, view: Writer) -> int:
        """Return how many frames were listed only at the end."""
        if not self._options.frame_list:
            return 0
        from analyzer.views.frames.cells import FrameWriter  # noqa: PLC0415 - few lists are of frames

        return view.waited if isinstance(view, FrameWriter) else 0

    def _write(self, view: Writer, batch: Batch, rows: ListedRows, out: IO[str]) -> None:
        count = self._options.count
        picked = rows if count is None else rows._replace(transfers=rows.transfers[: count - self._shown])
        for k, text in enumerate(self._run.unhurried(view.rows(batch, picked))):
            if self._shown == count:
                break
            out.write(text)
            self._shown += self._options.frame_list or k < len(picked.transfers)
