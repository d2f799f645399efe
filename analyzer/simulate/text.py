"""Recorded frames as lines of `candump -l`, microseconds since 1970."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dissectors.traffic import SimulatedFrame

_ERROR = 0x2000_0000


def line(frame: SimulatedFrame, start: int, buses: tuple[str, str]) -> str:
    """Return one line with its end; `start` is the time of the simulation's zero in ns since 1970."""
    micro = (start + frame.t) // 1000
    number = f"{frame.id | _ERROR * frame.error:0{8 if frame.extended or frame.error else 3}X}"
    body = frame.data.hex().upper()
    if frame.remote:
        body = "R" if frame.dlc is None else f"R{frame.dlc}"
    mark = f"##{int(frame.brs)}" if frame.fd else "#"
    whole = f"({micro // 1_000_000:010}.{micro % 1_000_000:06}) {buses[frame.bus]} {number}{mark}{body}\n"
    return f"{whole[: whole.index(number) + 5]}\n" if frame.garbled else whole
