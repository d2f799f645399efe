"""Faults of single frames (CAN rules): what no controller should put on this bus."""

from __future__ import annotations

from dissectors.traffic import Case, Fault, Frame


def _standard(case: Case) -> None:
    frame = Frame(case.random.randrange(0x800), case.random.randbytes(8), extended=False)
    case.say(f"a frame with the 11-bit identifier {frame.id:03X}")
    case.mark(frame)
    case.world.put([frame])


FAULTS: tuple[Fault, ...] = (Fault("CAN-001", "a frame with an 11-bit identifier", start=_standard),)
