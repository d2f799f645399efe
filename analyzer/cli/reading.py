"""A command's way to a `Run`: complaints on standard error, Ctrl-C at a line's end, progress, the sums at the end."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from analyzer.app import streams
from analyzer.app.interrupt import graceful
from analyzer.app.run import Run
from analyzer.app.start import plain_arrow
from analyzer.cli.progress import Progress, bytes_a_second
from analyzer.cli.status import USAGE
from analyzer.decode.engine import LINES
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
    try:
        run = Run(request, complaints, registry)
    except (DsdlError, ProfileError, OSError) as error:
        complaints(str(error))
        raise SystemExit(USAGE) from None
    try:
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


def account(run: Run, shown: int | None, *, of: str = "transfers") -> None:
    """Say the sums: every line and every frame, and how many transfers or frames were listed (None: no list)."""
    totals = run.totals
    kinds = "".join(f" + {count} {name}" for name, count in totals.verdicts.items() if count and name != "used")
    frames = totals.lines["frames"]
    every = run.transfers if of == "transfers" else frames
    listed = f"{run.transfers} transfers" if shown is None else f"{shown} of {every} {of} shown"
    streams.tell(f"-- {listed}; {lines_of(run)}; {frames} frames = {totals.verdicts['used']} used{kinds}\n")


def lines_of(run: Run) -> str:
    """Return what became of every line or record, as a sum."""
    lines = run.totals.lines
    rest = "".join(f" + {lines[name]} {name.replace('_', ' ')}" for name in LINES[2:] if lines[name])
    return f"{lines['lines']} {run.unit}s = {lines['frames']} frames{rest}"
