"""Proofs of TRF-001 to TRF-015, TRF-026, -027, -029 and -030: how the frames of a transfer follow each other."""

from __future__ import annotations

from binascii import crc_hqx
from itertools import pairwise
from typing import TYPE_CHECKING

from kit import encode

from witness import can
from witness.reader import SECOND, TIMEOUT, crc
from witness.views import unpack

if TYPE_CHECKING:
    from witness.reader import Frame, Log, Transfer
    from witness.views import Found

LONG = 100_000_000  # of a pause between two frames, in ns
SLOW = SECOND  # of a transfer, in ns
# What senders with the types' public files, but without OVERRIDE_SIGNATURE, or with other names for them, take.
MISTAKEN = {
    "RawCommand": (0xA7E6EFFE18544EA3,),
    "ParamCfg": (0x463BFAF8255DB99A,),
    "ESCStatus": (0xC67490B59FD75681,),
    "PUSHSCI": (0xFD19E66A5442CDEF,),
    "PUSHCAN": (0x99FD104A1AE97B69,),
    "ParamGet": (0xF133355A1D122629,),
}


def many(log: Log) -> list[Transfer]:
    """The transfers of several frames that are DroneCAN."""
    ours = can.trusted(log)
    return [one for one in log.transfers if one.many and one.first.session in ours]


def whole(log: Log) -> list[Transfer]:
    return [one for one in many(log) if one.whole]


def numbers(frames: list[Frame]) -> set[int]:
    return {frame.number for frame in frames}


def find_trf_001(log: Log) -> Found:
    return [{frame.number} for frame in can.honest(log) if frame.start and frame.end and frame.toggle]


def find_trf_002(log: Log) -> Found:
    return [{frame.number} for frame in can.honest(log) if frame.start and not frame.end and frame.toggle]


def find_trf_003(log: Log) -> Found:
    """`broken` starts with a frame that has the toggle of the one before, which it does not repeat."""
    return [numbers([one.frames[-1], one.broken[0]]) for one in many(log) if one.broken]


def find_trf_004(log: Log) -> Found:
    return [numbers([copy, before]) for one in log.transfers if one.many for copy, before in one.copies]


def _beside(log: Log, frame: Frame) -> list[Transfer]:
    """The transfers of its session that were open when the frame came."""
    near = log.by_session.get(frame.session, [])
    return [
        one
        for one in near
        if one.many
        and one.first.number < frame.number
        and (one.closed is None or one.closed.number > frame.number)
        and frame.t - one.t <= TIMEOUT
    ]


def find_trf_005(log: Log) -> Found:
    ours = can.trusted(log)
    lonely = [frame for frame in log.orphans if frame.session in ours and not _beside(log, frame)]
    groups: dict[object, list[Frame]] = {}
    for frame in lonely:
        groups.setdefault((frame.session, frame.tid, frame.t // TIMEOUT), []).append(frame)
    return [numbers(frames) for frames in groups.values()]


def find_trf_006(log: Log) -> Found:
    """A start, in the session, while this one still waited for its end; and that end never came."""
    found = []
    for one in many(log):
        if not one.whole:
            copies = {copy for copy, _ in one.copies}
            starts = [frame for frame in log.during(one) if frame.start and frame not in copies]
            if starts:
                found.append(one.numbers | numbers(starts[:1]))
    return found


def find_trf_007(log: Log) -> Found:
    """Nothing ended it for two seconds; or its last frame came after more than one."""
    return [
        one.numbers | numbers(_leftovers(log, one))
        for one in many(log)
        if one.status == "timed out" or (one.whole and one.frames[-1].t - one.t > SLOW)
    ]


def _leftovers(log: Log, one: Transfer) -> list[Frame]:
    """What came of a transfer after its time."""
    if one.status != "timed out":
        return []
    return [
        f for f in log.orphans if f.session == one.first.session and f.tid == one.first.tid and f.t > one.t + TIMEOUT
    ]


def find_trf_008(log: Log) -> Found:
    return [one.numbers for one in many(log) if one.status == "open"]


def find_trf_009(log: Log) -> Found:
    ours = can.trusted(log)
    found = []
    for frame in log.orphans:
        if frame.session in ours:
            found += [one.numbers | {frame.number} for one in _beside(log, frame) if one.first.tid != frame.tid][-1:]
    return found


def find_trf_010(log: Log) -> Found:
    return [one.numbers for one in many(log) if one.status == "bad crc"]


def explained(one: Transfer) -> str:
    """Which mistake makes the CRC of a transfer right, or nothing."""
    payload, right = one.payload, one.signature
    if one.crc in {crc(payload, wrong) for wrong in MISTAKEN.get(one.name, ())}:
        return "other signature"
    if one.crc == crc(payload, None):
        return "no signature"
    if one.crc == int.from_bytes(crc(payload, right).to_bytes(2, "little"), "big"):
        return "bytes swapped"
    joined = one.joined
    if int.from_bytes(joined[-2:], "little") == crc(joined[:-2], right):
        return "at the end"
    zeros = len(payload) - len(payload.rstrip(b"\0"))
    if any(crc(payload[: len(payload) - n], right) == one.crc for n in range(1, min(zeros, 63) + 1)):
        return "padding"
    return ""


def ways(one: Transfer) -> set[str]:
    """Which mistakes of 5.1 make the CRC right; one transfer alone may be right by chance."""
    signature = one.signature.to_bytes(8, "little")
    other = {
        "reversed": crc_hqx(signature[::-1] + one.payload, 0xFFFF),
        "from 0": crc_hqx(signature + one.payload, 0),
        "inverted": crc_hqx(signature + one.payload, 0xFFFF) ^ 0xFFFF,
    }
    return {name for name, value in other.items() if value == one.crc}


def find_trf_011(log: Log) -> Found:
    wrong = [one for one in many(log) if one.status == "bad crc"]
    known = [one for one in wrong if one.name]
    twice = [
        one
        for one in known
        if any(ways(one) & ways(more) for more in known if more is not one and more.first.session == one.first.session)
    ]
    return [one.numbers for one in wrong if one in twice or explained(one)]


def find_trf_012(log: Log) -> Found:
    return [{f.number} for f in can.honest(log) if not f.end and len(f.data) < (64 if f.fd else 8)]


def find_trf_013(log: Log) -> Found:
    return [{f.number} for f in can.honest(log) if f.end and not f.start and len(f.data) == 1]


def find_trf_014(log: Log) -> Found:
    return [{f.number} for f in can.honest(log) if f.start and not f.end and len(f.data) <= 3]


def find_trf_015(log: Log) -> Found:
    return [one.numbers for one in whole(log) if len(one.payload) <= 7]


def find_trf_026(log: Log) -> Found:
    found = []
    for one in many(log):
        last = one.every[-1].number
        others = {f.tid for f in log.during(one) if f.tid != one.first.tid and f.number < last}
        near = _beside_all(log, one) if others else []
        found += [one.numbers | other.numbers for other in near if other.first.tid in others]
    return found


def _beside_all(log: Log, one: Transfer) -> list[Transfer]:
    """The transfers of the same session with a frame between the first and the last of this one."""
    low, high = one.first.number, one.every[-1].number
    return [
        other
        for other in log.by_session[one.first.session]
        if other is not one and any(low < frame.number < high for frame in other.every)
    ]


def find_trf_027(log: Log) -> Found:
    return [
        numbers([before, frame])
        for one in many(log)
        for before, frame in pairwise(one.every)
        if frame.t - before.t > LONG
    ]


def find_trf_029(log: Log) -> Found:
    return [one.numbers for one in whole(log) if len(one.payload) > 1023]


def _needed(one: Transfer) -> int | None:
    """How many bytes of the payload the type fills; None if that cannot be told."""
    fields = unpack(one.name, one.payload, fd=True)
    return None if fields.missing or fields.tag is not None else len(one.payload) - len(fields.rest) // 8


def find_trf_030(log: Log) -> Found:
    found = []
    for one in log.transfers:
        if one.first.fd and one.name and one.whole:
            size = _needed(one)
            if size is not None and (any(one.payload[size:]) or len(one.joined) > _padded(size, one)):
                found.append(one.numbers)
    return found


def _padded(size: int, one: Transfer) -> int:
    """How long the frames of a transfer are together, tails left out, with no more padding than it needs."""
    size += 2 if one.many else 0
    before = max(0, size - 1) // 63 * 63
    return before + next(n for n in encode.DLC_LENGTHS if n > size - before) - 1
