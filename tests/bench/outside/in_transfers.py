"""Faults of whole transfers, of senders and of the recorder."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from bench.outside.in_frames import BROKEN, LOST
from bench.outside.kinds import Kinds
from bench.outside.trace import retail
from kit import encode
from kit.encode import Frame, Transfer

if TYPE_CHECKING:
    from collections.abc import Callable
    from random import Random

    from bench.outside.kinds import Case
    from bench.outside.trace import Trace

TRANSFERS = Kinds()
kind = TRANSFERS.kind
MS = 10**6
COUNTERS = "TYP-501 TYP-502 TYP-503 PUSH-009"
# What an old packet says does not fit what is now.
STALE = f"{COUNTERS} PUSH-102 PUSH-201 PUSH-304 PUSH-409 BUS-011 BUS-012 BUS-014"
SIGNATURES = {one.type_id: one.signature for one in encode.TYPES.values() if one.kind == "message"}


@kind("transfer lost", "TRF-016", LOST)
def lost(trace: Trace, rng: Random) -> Case:
    one = trace.pick(rng)
    frames = [frame for place, frame in enumerate(trace.frames) if place not in one.places]
    return trace.made(frames, trace.node(one), about=f"frames {one.places}")


@kind("transfer repeated", "TRF-017|TRF-004", STALE)
def repeated(trace: Trace, rng: Random) -> Case:
    one = trace.pick(rng, after=False, before=False)
    return trace.inserted(one.places[-1] + 1, [trace.frames[place] for place in one.places])


@kind("copy of a transfer after the next one", "TRF-017", STALE)
def late_copy(trace: Trace, rng: Random) -> Case:
    one = trace.pick(rng)
    after = trace.whole[one.after or 0]
    if after.after is None:
        raise LookupError("nothing shows that the counter goes on")
    at = after.places[-1] + 1
    return trace.inserted(at, [trace.frames[place] for place in one.places])


@kind("two transfers change places", "TRF-016|TRF-017|TRF-018|TRF-019|TRF-026", f"BUS-013 BUS-021 {STALE}")
def exchanged(trace: Trace, rng: Random) -> Case:
    one = trace.pick(rng)
    other = trace.whole[one.after or 0]
    if len(other.places) != len(one.places):
        raise LookupError("of other lengths")
    frames = list(trace.frames)
    for here, there in zip(one.places, other.places, strict=True):
        frames[here] = replace(trace.frames[there], t=frames[here].t)
        frames[there] = replace(trace.frames[here], t=frames[there].t)
    return trace.made(frames, trace.node(one), about=f"frames {one.places} and {other.places}")


@kind(
    "two transfers take turns", "TRF-026|TRF-009|TRF-003", f"TRF-009 TRF-026 TRF-027 BUS-010 PUSH-409 TYP-210 {BROKEN}"
)
def interleaved(trace: Trace, rng: Random) -> Case:
    one = trace.pick(rng, 2)
    other = trace.whole[one.after or 0]
    if len(other.places) < 2:
        raise LookupError("one frame")
    order = [place for pair in zip(one.places, other.places, strict=False) for place in pair]
    order += [place for place in (*one.places, *other.places) if place not in order]
    slots = sorted(order)
    frames = list(trace.frames)
    for slot, place in zip(slots, order, strict=True):
        frames[slot] = replace(trace.frames[place], t=trace.frames[slot].t)
    return trace.made(frames, trace.node(one), about=f"frames {slots}")


@kind("transfer begun, then begun again", "TRF-006|TRF-004", "")
def begun_again(trace: Trace, rng: Random) -> Case:
    one = trace.pick(rng, 3, after=False, before=False)
    upto = rng.randrange(2, len(one.places))
    return trace.inserted(one.places[0], [trace.frames[place] for place in one.places[:upto]])


@kind("all IDs of one transfer", "TRF-016|TRF-017|TRF-018|TRF-019", "")
def number(trace: Trace, rng: Random) -> Case:
    one, flip = trace.pick(rng), rng.randrange(1, 32)
    frames = list(trace.frames)
    for place in one.places:
        frames[place] = retail(frames[place], flip)
    return trace.made(frames, trace.node(one), about=f"frames {one.places}, ID xor {flip}")


@kind("transfer ID stands still", "TRF-017|TRF-018", "")
def stuck(trace: Trace, rng: Random) -> Case:
    return renumbered(trace, rng, lambda _, first: first)


@kind("transfer IDs of 4 bits", "TRF-016|TRF-019", "")
def narrow(trace: Trace, rng: Random) -> Case:
    return renumbered(trace, rng, lambda now, _: now & 15)


@kind("transfer ID in steps of 2", "TRF-016|TRF-020", "TRF-017 TRF-018 TRF-019")
def double(trace: Trace, rng: Random) -> Case:
    return renumbered(trace, rng, lambda now, _: now * 2 % 32)


def renumbered(trace: Trace, rng: Random, new: Callable[[int, int], int]) -> Case:
    """A session of at least 40 transfers has other IDs from a place on."""
    sessions = {one.session for one in trace.whole}
    long = sorted(s for s in sessions if sum(one.session == s for one in trace.whole) >= 40)
    if not long:
        raise LookupError("no long session")
    session = rng.choice(long)
    mine = [one for one in trace.whole if one.session == session]
    mine = mine[rng.randrange(len(mine) - 36) :]
    frames = list(trace.frames)
    first = frames[mine[0].places[0]].data[-1] & 31
    for one in mine:
        for place in one.places:
            now = frames[place].data[-1] & 31
            frames[place] = retail(frames[place], now ^ new(now, first))
    return trace.made(frames, trace.node(mine[0]), about=f"from frame {mine[0].places[0] + 1}")


def with_crc(trace: Trace, rng: Random, crc: Callable[[int, bytes], bytes]) -> Case:
    """All transfers of a sender have another CRC from a place on, made from signature (4.3.1) and payload."""
    sessions = [one.session for one in trace.whole if len(one.places) > 1 and not one.session & 0x80]
    often = sorted({one for one in sessions if sessions.count(one) >= 3 and one >> 8 in SIGNATURES})
    if not often:
        raise LookupError("none comes three times")
    session = rng.choice(often)
    mine = [one for one in trace.whole if one.session == session and len(one.places) > 1]
    frames = list(trace.frames)
    mine = mine[rng.randrange(len(mine) - 2) :]
    for one in mine:
        payload = b"".join(trace.frames[place].data[:-1] for place in one.places)[2:]
        first = frames[one.places[0]]
        frames[one.places[0]] = replace(first, data=crc(SIGNATURES[session >> 8], payload) + first.data[2:])
    return trace.made(frames, session & 0x7F, about=f"{session >> 8} of node {session & 0x7F}, {len(mine)} transfers")


def little(value: int) -> bytes:
    return value.to_bytes(2, "little")


def of(signature: bytes, payload: bytes, start: int = 0xFFFF) -> int:
    return encode.crc16(payload, encode.crc16(signature, start))


def low(signature: int) -> bytes:
    return signature.to_bytes(8, "little")


WRONG_CRCS = {
    "bytes of the CRC in the other order": lambda s, p: of(low(s), p).to_bytes(2, "big"),
    "CRC without the signature": lambda _, p: little(encode.crc16(p)),
    "CRC with the signature's bytes reversed": lambda s, p: little(of(low(s)[::-1], p)),
    "CRC from 0": lambda s, p: little(of(low(s), p, 0)),
    "CRC inverted": lambda s, p: little(of(low(s), p) ^ 0xFFFF),
    "CRC of another type's signature": lambda s, p: little(of(low(0x948F5E0B33E0EDEE ^ (s == 0x948F5E0B33E0EDEE)), p)),
}


def _wrong_crc(name: str, crc: Callable[[int, bytes], bytes]) -> None:
    @kind(name, "TRF-010 TRF-011", f"BUS-007 BUS-020 BUS-025 BUS-027 BUS-035 TYP-103 {LOST}")
    def wrong(trace: Trace, rng: Random) -> Case:
        return with_crc(trace, rng, crc)


for _name, _crc in WRONG_CRCS.items():
    _wrong_crc(_name, _crc)


@kind("several frames where one is enough", "TRF-015", "")
def too_many(trace: Trace, rng: Random) -> Case:
    one = trace.pick(rng, 1, 1, after=False, before=False)
    frame = trace.frames[one.places[0]]
    signature = SIGNATURES.get(one.session >> 8)
    if signature is None or len(frame.data) < 8:
        raise LookupError("no signature, or no 7 bytes")
    body = little(of(low(signature), frame.data[:-1])) + frame.data[:-1]
    number = frame.data[-1] & 31
    new = [
        replace(frame, data=body[:7] + bytes([0x80 | number])),
        replace(frame, data=body[7:] + bytes([0x60 | number])),
    ]
    place = one.places[0]
    return trace.made([*trace.frames[:place], *new, *trace.frames[place + 1 :]], trace.node(one))


@kind(
    "source 0 in all frames of a transfer",
    "CAN-009",
    f"CAN-008 CAN-013 TYP-103 TYP-208 TYP-301 TYP-403 BUS-009 BUS-023 {LOST}",
)  # one more node sends throttle, then
def nameless(trace: Trace, rng: Random) -> Case:
    one = trace.pick(rng, 2)
    frames = list(trace.frames)
    for place in one.places:
        frames[place] = replace(frames[place], id=frames[place].id & ~0x7F)
    return trace.made(frames, 0, trace.node(one), about=f"frames {one.places}")


@kind("priority of a type of table 4.3.1", "CAN-013", "")
def priority(trace: Trace, rng: Random) -> Case:
    fit = [one for one in trace.whole if one.session >> 8 in {1030, 1033, 1034, 1038, 1039, 1332}]
    if not fit:
        raise LookupError("none of them")
    one = rng.choice(fit)
    frames = list(trace.frames)
    new = rng.choice([p for p in range(31) if p != frames[one.places[0]].id >> 24])
    for place in one.places:
        frames[place] = replace(frames[place], id=frames[place].id & 0xFFFFFF | new << 24)
    return trace.made(frames, trace.node(one), about=f"frames {one.places}")


@kind(
    "block of frames comes again",
    "TRF-016|TRF-017|TRF-018|TRF-019|BUS-010",
    f"TRF-* CAN-014 BUS-010 BUS-021 BUS-037 PUSH-407 {COUNTERS}",
)
def replayed(trace: Trace, rng: Random) -> Case:
    size = rng.randrange(20, 80)
    start = rng.randrange(len(trace.frames) - size)
    block = trace.frames[start : start + size]
    at = min(start + size + rng.randrange(1, 200), len(trace.frames) - 1)
    return trace.inserted(at, block, *(frame.id & 0x7F for frame in block))


@kind(
    "second sender with the same node ID",
    "BUS-010",
    "TRF-* CAN-013 CAN-014 BUS-006 BUS-018 BUS-020 BUS-021 PUSH-407 BUS-037 BUS-028 TYP-103 BUS-007",
)
def impostor(trace: Trace, rng: Random) -> Case:
    """It sends throttle as the autopilot does (4.4.1), with a counter of its own."""
    known = [one for one in trace.whole if one.session >> 8 == 1030]
    if len(known) < 100:
        raise LookupError("no throttle")
    node, body = trace.node(known[0]), b"".join(trace.frames[place].data[:-1] for place in known[0].places)
    payload = body[2:] if len(known[0].places) > 1 else body
    high = trace.frames[known[0].places[0]].id >> 24
    frames, count = [], rng.randrange(32)
    period, start = rng.randrange(4, 11) * MS, trace.frames[0].t + rng.randrange(400) * MS
    due = start
    for frame in trace.frames:
        frames.append(frame)
        if frame.t >= due and frame.id & 0xFFFFFF != known[0].session:
            one = Transfer("message", 1030, node, payload, SIGNATURES[1030], count % 32, priority=high)
            frames += [replace(new, t=frame.t, bus=frame.bus) for new in one.frames()]
            count, due = count + 1, due + period
    return trace.made(frames, node, about=f"every {period // MS} ms from {(start - trace.frames[0].t) // MS} ms on")


@kind("time steps back", "CAP-001", "")
def back(trace: Trace, rng: Random) -> Case:
    at, step = rng.randrange(50, len(trace.frames) - 50), rng.choice([5, 50, 500]) * MS
    frames = [replace(frame, t=frame.t - step * (place >= at)) for place, frame in enumerate(trace.frames)]
    return trace.made(frames, *{one.session & 0x7F for one in trace.whole}, about=f"frame {at + 1}, {step // MS} ms")


@kind("time steps forward", "CAP-002", BROKEN)
def forward(trace: Trace, rng: Random) -> Case:
    at, step = rng.randrange(50, len(trace.frames) - 50), rng.randrange(2, 9) * 1000 * MS
    frames = [replace(frame, t=frame.t + step * (place >= at)) for place, frame in enumerate(trace.frames)]
    return trace.made(frames, *{one.session & 0x7F for one in trace.whole}, about=f"frame {at + 1}, {step // MS} ms")


@kind("service call to node 0", "CAN-006", "TRF-022")
def to_nobody(trace: Trace, rng: Random) -> Case:
    return call(trace, rng, src=rng.randrange(1, 126), dst=0)


@kind("service call from node 0", "CAN-007", "TRF-021 TRF-022")
def from_nobody(trace: Trace, rng: Random) -> Case:
    return call(trace, rng, src=0, dst=rng.randrange(1, 126))


@kind("service call to itself", "CAN-012", "TRF-022")
def to_itself(trace: Trace, rng: Random) -> Case:
    return call(trace, rng, src=(node := rng.randrange(1, 126)), dst=node)


def call(trace: Trace, rng: Random, src: int, dst: int) -> Case:
    asked = Frame(0x1E018080 | dst << 8 | src, bytes([0xC0 | rng.randrange(32)]), bus=trace.frames[0].bus)
    return trace.inserted(rng.randrange(1, len(trace.frames)), [asked], dst)


@kind("line that is no frame", "CAP-003", "")
def garbage(trace: Trace, rng: Random) -> Case:
    lines = trace.text.splitlines(keepends=True)
    lines.insert(rng.randrange(1, len(lines)), "(17xx) can0 what is this\n")
    return replace(trace.made([], about="a line"), text="".join(lines))


@kind("last line cut", "CAP-003", f"CAN-005 {BROKEN}")
def cut(trace: Trace, rng: Random) -> Case:
    return replace(trace.made([], trace.frames[-1].id & 0x7F), text=trace.text[: -rng.randrange(2, 9)])


@kind("traffic of another protocol", "CAN-015|CAN-018", "")
def foreign(trace: Trace, rng: Random) -> Case:
    """J1939 engine speed from source 0x00 (PGN 61444), whose last byte is no tail."""
    frames, due = [], trace.frames[0].t
    for frame in trace.frames:
        frames.append(frame)
        if frame.t >= due:
            data = bytes([rng.randrange(256) for _ in range(7)]) + b"\xff"
            frames.append(Frame(0x0CF00400 | 0x21, data, frame.t, frame.bus))
            due += 10 * MS
    return trace.made(frames, 0x21)


# What the recorder lost is nobody's fault; a rest without a start may be of any protocol.
RECORDER = "CAN-018:note TRF-*:note PUSH-*:note TYP-5*:note BUS-*:note CAP-002"


def together(trace: Trace, begin: int) -> set[int]:
    """The nodes of a capture in which at least three sent again and again just before, so that all lack the same."""
    frames = (trace.frames[one.places[0]] for one in trace.whole)
    nodes = [frame.id & 0x7F for frame in frames if begin - 300 * MS < frame.t < begin]
    if sum(nodes.count(node) >= 5 for node in set(nodes)) < 3:
        raise LookupError("too few of them")
    return {one.session & 0x7F for one in trace.whole}


@kind("recorder loses everything for a while", "CAP-006|CAP-004|CAP-002", RECORDER)
def blind(trace: Trace, rng: Random) -> Case:
    """No sender pauses alone: all are silent together, and their counters have gone on."""
    length = rng.randrange(350, 700) * MS
    begin = trace.frames[0].t + rng.randrange(300, 1100) * MS
    frames = [frame for frame in trace.frames if not begin < frame.t < begin + length]
    return trace.made(frames, *together(trace, begin), about=f"for {length // MS} ms")


@kind("recorder loses every third frame for a while", "CAP-006|CAP-004", RECORDER)
def patchy(trace: Trace, rng: Random) -> Case:
    begin = trace.frames[0].t + rng.randrange(100, 700) * MS
    frames = [frame for frame in trace.frames if not begin < frame.t < begin + 1000 * MS or rng.random() > 0.3]
    return trace.made(frames, *together(trace, begin), about="for 1 s")
