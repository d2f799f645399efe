"""What commands that send have to say: what they would send, what they did not, and why."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.cli import DAMAGED, USAGE, streams
from analyzer.live.outlet import ActuationError
from analyzer.live.sender import SECOND
from analyzer.views.actuation import render

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Sequence

    from analyzer.live.interfaces import InterfaceError
    from analyzer.live.outlet import Outlet

ERROR_FRAMES = "error frames, which only a controller makes"


def refuse(outlet: Outlet, rows: Sequence[tuple[str, str, int]], seconds: float, who: str) -> None:
    """Says what would actuate something there, as counted in so many seconds of sending."""
    streams.complain(f"{outlet.interface.name} may be real: {outlet.doubt}; this would be sent:", who)
    streams.tell(render(rows, seconds))


def refused() -> int:
    """The last word on it; the exit status."""
    streams.tell("-- nothing was sent; --allow-actuation sends it: motors have propellers\n")
    return USAGE


def failed(error: InterfaceError | ActuationError, who: str) -> int:
    """Says what ended the sending; the exit status."""
    if isinstance(error, ActuationError):
        streams.complain(str(error), who)
        return USAGE
    streams.complain(str(error))
    return DAMAGED


def shortfall(left_out: Counter[str], behind: int) -> None:
    """Says what could not be sent, and how much later (ns) the rest was sent."""
    if left_out:
        texts = (f"{what} ({count:,})" for what, count in left_out.items())
        streams.tell(f"-- not sent: {'; '.join(texts)}\n")
    if behind:
        streams.tell(f"-- this machine was too slow: the rest came {behind / SECOND:.1f} s later\n")
