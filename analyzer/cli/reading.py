"""A command's way to a `Run`: complaints on standard error, Ctrl-C at a line's end, progress, the sums at the end."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from analyzer.app.process import streams
from analyzer.app.process.interrupt import graceful
from analyzer.app.process.start import keep_memory, plain_arrow
from analyzer.app.run import Run
from analyzer.cli import status
from analyzer.cli.progress import Progress, bytes_a_second
from analyzer.decode.core import LINES
from dissectors import DsdlError, ProfileError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from analyzer.app.request import Request
    from analyzer.cli.complaints import Complaints
    from analyzer.cli.progress import Measurable
    from dissectors import Registry


@contextmanager
def reading(request: Request, complaints: Complaints, registry: Registry | None = None) -> Iterator[Run]:
    """Read what is asked for; the `Run` says afterwards how that went. Wrong dissector folders end the command."""
    plain_arrow()
    keep_memory()
    try:
        run = Run(request, complaints, registry)
    except (DsdlError, ProfileError, OSError) as error:
        raise SystemExit(status.usage(error, "tailbyte")) from None
    try:
        if request.flight is not None:
            from analyzer.app.flown import narrow  # noqa: PLC0415 - few ask for a flight

            with graceful(lambda: run):
                reason = narrow(run)
            if run.stopped:
                raise KeyboardInterrupt
            if reason is not None:
                raise SystemExit(status.usage(reason, "tailbyte"))
        with graceful(lambda: run), run:
            yield run
    finally:
        complaints.release()


@contextmanager
def watched(
    work: Measurable,
    complaints: Complaints,
    *,
    wanted: bool = True,
    speed: Callable[[float], str] = bytes_a_second,
) -> Iterator[Progress]:
    """Show how far `work` has come; complaints wait until that is through."""
    try:
        with Progress(work, wanted=wanted, speed=speed) as progress:
            complaints.hold(progress.active)
            yield progress
    finally:
        complaints.release()


def account(
    run: Run, shown: int | None, *, frames: bool = False, match: bool = False, beside: tuple[int, int] = (0, 0),
    elsewhere: bool = False,
) -> None:  # fmt: skip
    """Say the sums: every line and every frame, and how many transfers, or `frames`, were listed (None: no list).

    With `match` those match a filter, and so do `beside` them so many frames that form none and error frames, which
    are listed `elsewhere`.
    """
    totals = run.totals
    kinds = "".join(f" + {count} {name}" for name, count in totals.verdicts.items() if count and name != "used")
    count = totals.lines["frames"]
    others = totals.lines["error_frames"] if frames else 0
    every = f"{count + others} frames" if frames else f"{run.transfers} transfers"
    every += " and error frames" if others else ""
    listed = every if shown is None else f"{shown} of {every} {'match' if match else 'shown'}"
    loose, errors = beside
    listed += f", and {loose} frame{'s' * (loose > 1)} without one" if loose else ""
    listed += f", and {errors} error frame{'s' * (errors > 1)}" if errors else ""
    listed += ": rows of --frame-list" if elsewhere and (loose or errors) else ""
    streams.tell(f"-- {listed}; {lines_of(run)}; {count} frames = {totals.verdicts['used']} used{kinds}\n")


def lines_of(run: Run) -> str:
    """Return what became of every line or record, as a sum."""
    lines = run.totals.lines
    rest = "".join(f" + {lines[name]} {name.replace('_', ' ')}" for name in LINES[2:] if lines[name])
    return f"{lines['lines']} {run.unit}s = {lines['frames']} frames{rest}"
