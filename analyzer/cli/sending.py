"""The words of commands that send: what they would send, what they did not, and why."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.app.process import streams
from analyzer.cli import status
from analyzer.live.replay.outlet import ActuationError
from analyzer.views.actuation import render
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Sequence

    from analyzer.live.interfaces.naming import InterfaceError
    from analyzer.live.replay.outlet import Outlet

ERROR_FRAMES = "error frames, which only a controller makes"


def refuse(outlet: Outlet, rows: Sequence[tuple[str, str, int]], seconds: float, who: str) -> None:
    """Say what would actuate something there, as counted in so many seconds of sending."""
    streams.complain(f"{outlet.interface.name} may be real: {outlet.doubt}; this would be sent:", who)
    streams.tell(render(rows, seconds))


def refused() -> int:
    """Say the last word on it; return the exit status."""
    streams.tell("-- nothing was sent; --allow-actuation sends it: motors have propellers\n")
    return status.USAGE


def failed(error: InterfaceError | ActuationError, who: str) -> int:
    """Say what ended the sending; return the exit status."""
    if isinstance(error, ActuationError):
        return status.usage(error, who)
    return status.damaged(error)


def shortfall(left_out: Counter[str], behind: int) -> None:
    """Say what could not be sent, and how much later (ns) the rest was sent."""
    if left_out:
        texts = (f"{what} ({count:,})" for what, count in left_out.items())
        streams.tell(f"-- not sent: {'; '.join(texts)}\n")
    if behind:
        streams.tell(f"-- this machine was too slow: the rest came {behind / SECOND:.1f} s later\n")
