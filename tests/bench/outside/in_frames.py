"""Faults of single frames: lost, repeated, moved; each part of the identifier, the length and the tail byte."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from bench.outside.kinds import Kinds
from bench.outside.trace import flipped, retail
from kit.encode import Frame

if TYPE_CHECKING:
    from random import Random

    from bench.outside.kinds import Case
    from bench.outside.trace import Trace

FRAMES = Kinds()
kind = FRAMES.kind
# What may follow where a transfer is lost to its receiver: its ID, and the counters in its payload (4.4.4, 4.4.5).
LOST = "TRF-016 TYP-501 PUSH-009 PUSH-102 PUSH-201 PUSH-304 BUS-011 BUS-012 BUS-030"
# 4.1.3: what each rest of a broken transfer is, when what it is part of never comes.
BROKEN = f"TRF-003 TRF-005 TRF-006 TRF-007 TRF-008 {LOST}"
START, END, TOGGLE = 0x80, 0x40, 0x20


@kind("first frame lost", "TRF-005", LOST)
def first_lost(trace: Trace, rng: Random) -> Case:
    return trace.changed(trace.pick(rng, 2).places[0], None)


# Where the frames on both sides are alike, what is left looks like a repetition in a transfer whose CRC is wrong.
@kind("middle frame lost", "TRF-003|TRF-010", f"TRF-004 {BROKEN}")
def middle_lost(trace: Trace, rng: Random) -> Case:
    return trace.changed(rng.choice(trace.pick(rng, 3).places[1:-1]), None)


@kind("last frame lost", "TRF-006|TRF-007", f"TRF-007 TRF-008 {LOST}")
def last_lost(trace: Trace, rng: Random) -> Case:
    return trace.changed(trace.pick(rng, 2).places[-1], None)


@kind("frame repeated at once", "TRF-004", "")
def repeated(trace: Trace, rng: Random) -> Case:
    place = rng.choice(trace.pick(rng, 2).places[:-1])
    return trace.inserted(place + 1, [trace.frames[place]])


@kind("last frame repeated at once", "TRF-004|TRF-005", "")
def last_repeated(trace: Trace, rng: Random) -> Case:
    place = trace.pick(rng, 2).places[-1]
    return trace.inserted(place + 1, [trace.frames[place]])


@kind("single frame repeated", "TRF-017|TRF-004", "")
def single_repeated(trace: Trace, rng: Random) -> Case:
    place = trace.pick(rng, 1, 1, after=False, before=False).places[0]
    return trace.inserted(place + 1, [trace.frames[place]])


@kind("late copy of a frame inside the next transfer", "TRF-004|TRF-009|TRF-026", "TRF-009 TRF-026", "copy")
def late_copy(trace: Trace, rng: Random) -> Case:
    one = trace.pick(rng, 2)
    after = trace.whole[one.after or 0]
    if len(after.places) < 2:
        raise LookupError("the next one has one frame")
    return trace.inserted(after.places[1], [trace.frames[rng.choice(one.places[1:])]])


@kind("first two frames change places", "TRF-003|TRF-005|TRF-006", BROKEN, "swapped|order")
def first_swapped(trace: Trace, rng: Random) -> Case:
    return swapped(trace, trace.pick(rng, 2).places, 0)


@kind("two later frames change places", "TRF-003", BROKEN)
def later_swapped(trace: Trace, rng: Random) -> Case:
    places = trace.pick(rng, 3).places
    return swapped(trace, places, rng.randrange(1, len(places) - 1))


def swapped(trace: Trace, places: tuple[int, ...], at: int) -> Case:
    frames, (one, other) = list(trace.frames), places[at : at + 2]
    frames[one], frames[other] = replace(frames[other], t=frames[one].t), replace(frames[one], t=frames[other].t)
    return trace.made(frames, frames[one].id & 0x7F, about=f"frames {one + 1} and {other + 1}")


@kind("bit of the payload", "TRF-010", LOST + " TRF-011")
def payload_bit(trace: Trace, rng: Random) -> Case:
    places = trace.pick(rng, 2).places
    place = rng.choice(places)
    frame, first = trace.frames[place], 2 if place == places[0] else 0
    if len(frame.data) - 1 <= first:
        raise LookupError("no payload")
    return trace.changed(place, flipped(frame, rng.randrange(first, len(frame.data) - 1), 1 << rng.randrange(8)))


@kind("bit of the CRC", "TRF-010", LOST + " TRF-011")
def crc_bit(trace: Trace, rng: Random) -> Case:
    place = trace.pick(rng, 2).places[0]
    return trace.changed(place, flipped(trace.frames[place], rng.randrange(2), 1 << rng.randrange(8)))


@kind("toggle of a single frame", "TRF-001", "")
def single_toggle(trace: Trace, rng: Random) -> Case:
    return tail(trace, trace.pick(rng, 1, 1, after=False, before=False).places[0], TOGGLE)


@kind("toggle of the first frame", "TRF-002|TRF-003", BROKEN)
def first_toggle(trace: Trace, rng: Random) -> Case:
    return tail(trace, trace.pick(rng, 2).places[0], TOGGLE)


@kind("toggle of a later frame", "TRF-003|TRF-010", f"TRF-004 {BROKEN}")
def later_toggle(trace: Trace, rng: Random) -> Case:
    return tail(trace, rng.choice(trace.pick(rng, 2).places[1:]), TOGGLE)


@kind("start missing in a single frame", "TRF-005", LOST)
def single_start(trace: Trace, rng: Random) -> Case:
    return tail(trace, trace.pick(rng, 1, 1).places[0], START)


@kind("start missing in the first frame", "TRF-005", LOST)
def first_start(trace: Trace, rng: Random) -> Case:
    return tail(trace, trace.pick(rng, 2).places[0], START)


@kind(
    "start set in a later frame",
    "TRF-001|TRF-002|TRF-006",
    f"TRF-010 TRF-011 TRF-012 TRF-017 TRF-018 TYP-* PUSH-00* {BROKEN}",
)
def later_start(trace: Trace, rng: Random) -> Case:
    return tail(trace, rng.choice(trace.pick(rng, 2).places[1:]), START)


@kind("end missing", "TRF-006|TRF-007", f"TRF-008 TRF-012 TRF-014 {LOST}")
def end_missing(trace: Trace, rng: Random) -> Case:
    return tail(trace, trace.pick(rng).places[-1], END)


@kind("end set in the first frame", "TRF-005|TYP-00*", f"TYP-* PUSH-* {LOST}")
def first_end(trace: Trace, rng: Random) -> Case:
    return tail(trace, trace.pick(rng, 2).places[0], END)


@kind("end set in a middle frame", "TRF-010|TRF-005", f"TRF-011 TRF-015 {LOST}")
def middle_end(trace: Trace, rng: Random) -> Case:
    return tail(trace, rng.choice(trace.pick(rng, 3).places[1:-1]), END)


def tail(trace: Trace, place: int, bits: int) -> Case:
    return trace.changed(place, retail(trace.frames[place], bits))


@kind("transfer ID of the first frame", "TRF-009|TRF-006", f"TRF-009 {BROKEN}", "transfer ID")
def first_number(trace: Trace, rng: Random) -> Case:
    return tail(trace, trace.pick(rng, 2).places[0], rng.randrange(1, 32))


@kind("transfer ID of a later frame", "TRF-009", f"TRF-026 {BROKEN}")
def later_number(trace: Trace, rng: Random) -> Case:
    return tail(trace, rng.choice(trace.pick(rng, 2).places[1:]), rng.randrange(1, 32))


@kind("inner frame shortened", "TRF-012", f"TRF-010 TRF-011 TRF-014 {LOST}")
def shortened(trace: Trace, rng: Random) -> Case:
    place = rng.choice(trace.pick(rng, 2).places[:-1])
    frame = trace.frames[place]
    keep = rng.randrange(1, len(frame.data) - 1)
    return trace.changed(place, replace(frame, data=frame.data[:keep] + frame.data[-1:]))


@kind("first frame with no more than the CRC", "TRF-014", f"TRF-010 TRF-011 TRF-012 {LOST}")
def only_crc(trace: Trace, rng: Random) -> Case:
    place = trace.pick(rng, 2).places[0]
    frame = trace.frames[place]
    return trace.changed(place, replace(frame, data=frame.data[: rng.randrange(1, 3)] + frame.data[-1:]))


@kind("last frame shortened", "TRF-010", f"TRF-011 TRF-013 {LOST}")
def last_shortened(trace: Trace, rng: Random) -> Case:
    place = trace.pick(rng, 2).places[-1]
    frame = trace.frames[place]
    if len(frame.data) < 2:
        raise LookupError("no payload")
    return trace.changed(place, replace(frame, data=frame.data[: rng.randrange(len(frame.data) - 1)] + frame.data[-1:]))


@kind("last frame padded", "TRF-010", f"TRF-011 {LOST}", "pad|zero")
def last_padded(trace: Trace, rng: Random) -> Case:
    place = trace.pick(rng, 2).places[-1]
    frame = trace.frames[place]
    if len(frame.data) > 7:
        raise LookupError("no room")
    return trace.changed(place, replace(frame, data=frame.data[:-1].ljust(7, b"\0") + frame.data[-1:]))


@kind("frame without data", "CAN-005", f"TRF-004 TRF-010 {BROKEN}")
def emptied(trace: Trace, rng: Random) -> Case:
    place = rng.choice(trace.pick(rng).places)
    return trace.changed(place, replace(trace.frames[place], data=b""))


@kind("remote frame", "CAN-002", f"TRF-004 TRF-010 {BROKEN}")
def remote(trace: Trace, rng: Random) -> Case:
    place = rng.choice(trace.pick(rng).places)
    return trace.changed(place, replace(trace.frames[place], data=b"", remote=True, dlc=len(trace.frames[place].data)))


@kind("11-bit identifier", "CAN-001", f"TRF-004 TRF-010 {BROKEN}")
def standard(trace: Trace, rng: Random) -> Case:
    place = rng.choice(trace.pick(rng).places)
    frame = replace(trace.frames[place], id=trace.frames[place].id & 0x7FF, extended=False)
    return trace.changed(place, frame)


@kind("error frame", "CAN-004", "BUS-005")
def error_frame(trace: Trace, rng: Random) -> Case:
    place = rng.randrange(1, len(trace.frames))
    return trace.inserted(place, [Frame(0x8, bytes(8), error=True, bus=trace.frames[0].bus)])


@kind("priority of one frame", "CAN-014", f"CAN-013 {BROKEN}")
def priority(trace: Trace, rng: Random) -> Case:
    place = rng.choice(trace.pick(rng, 2).places)
    frame = trace.frames[place]
    return trace.changed(place, replace(frame, id=frame.id ^ rng.randrange(1, 32) << 24))


@kind(
    "source of one frame",
    "TRF-003|TRF-005|TRF-006",
    f"CAN-009 CAN-011 CAN-013 CAN-018 BUS-020 TRF-004 TRF-010 {BROKEN}",
)
def source(trace: Trace, rng: Random) -> Case:
    place = rng.choice(trace.pick(rng, 2).places)
    frame = trace.frames[place]
    other = frame.id & 0x7F ^ rng.randrange(1, 128)
    return trace.changed(place, replace(frame, id=frame.id & ~0x7F | other), other)


@kind(
    "bit of the identifier",
    "CAN-014|TRF-003|TRF-005|TRF-006",
    f"CAN-0* BUS-020 TRF-004 TRF-010 TRF-021 TRF-022 {BROKEN}",
)
def id_bit(trace: Trace, rng: Random) -> Case:
    place = rng.choice(trace.pick(rng, 2).places)
    frame = trace.frames[place]
    number = frame.id ^ 1 << rng.randrange(29)
    return trace.changed(place, replace(frame, id=number), number & 0x7F, number >> 8 & 0x7F)
