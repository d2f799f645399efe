"""Whose traffic is it: which frames with 29 bits are DroneCAN, and what is known of types without a layout here."""

from __future__ import annotations

from collections import Counter, defaultdict
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

from witness.frame import KNOWN

if TYPE_CHECKING:
    from witness.frame import Frame
    from witness.reader import Key, Log, Transfer

# Message types that are known though encode.TYPES has no layout of them, with their signatures.
FOC_CTRL = 1035
OTHERS = {
    ("message", FOC_CTRL): 0x598143612FBC000B,  # com.tmotor.esc.FocCtrl
    ("message", 1000): 0x72A63A3C6F41FA9B,  # uavcan.equipment.ahrs.Solution
    ("message", 2018): 0x5D09E48551CE9194,  # com.himark.servo.ServoCmd
    ("message", 2019): 0xCA8F4B8F97D23B57,  # com.himark.servo.ServoInfo
}
# One more type with an ID that is taken: the T-Motor CloudLink instruction.
COLLISIONS = {("message", 1000): 0x1362AB78CD12F03A}
VENDORS = {1033, FOC_CTRL, 1038, 1039, 1332, 2018, 2019}
# Those of them that the document itself, or its earlier version, puts into the standard range (4.3.1).
BY_DESIGN = {1033, FOC_CTRL, 1038, 1039, 1332}
_PROOF, _PATIENCE = 3, 16


def known(frame: Frame) -> bool:
    """Is there a type for its ID?"""
    kind = "message" if frame.kind == "anonymous" else frame.kind
    return (kind, frame.type_id) in KNOWN or (kind, frame.type_id) in OTHERS


def crc_start(payload: bytes, value: int) -> int:
    """The CRC backwards: the value from which `payload` gives `value`."""
    for byte in reversed(payload):
        for _ in range(8):
            value = (value ^ 0x1021) >> 1 | 0x8000 if value & 1 else value >> 1
        value ^= byte << 8
    return value


def starts(transfers: list[Transfer]) -> list[int]:
    """With which value the CRC of each one begins, if it arrived undamaged."""
    return [crc_start(one.payload, one.crc) for one in transfers if one.many and one.whole]


def _believed(transfers: list[Transfer]) -> bool:
    run = 1
    for before, one in pairwise(transfers):
        run = run + 1 if one.first.tid == (before.first.tid + 1) % 32 else 1
        if run >= _PROOF:
            return True
    same = Counter(starts(transfers))
    return bool(same) and max(same.values()) > 1


@lru_cache(maxsize=4)
def trusted(log: Log) -> set[Key]:
    """The sessions that are DroneCAN: of a known type unless nothing ever makes sense, of an unknown one with proof."""
    found = set()
    for key, frames in log.sessions.items():
        transfers = log.by_session.get(key, [])
        if known(frames[0]):
            if len(frames) < _PATIENCE or any(one.whole and one.status != "bad crc" for one in transfers):
                found.add(key)
        elif _believed(transfers):
            found.add(key)
    return found


@lru_cache(maxsize=4)
def honest(log: Log) -> list[Frame]:
    """The frames with a tail byte that are DroneCAN."""
    return [frame for key in trusted(log) for frame in log.sessions[key]]


def unknown(log: Log) -> dict[tuple[str, int], list[Transfer]]:
    """The believed transfers of every type that is not known."""
    found = defaultdict(list)
    for key in trusted(log):
        frame = log.sessions[key][0]
        if not known(frame):
            found[frame.kind, frame.type_id] += log.by_session.get(key, [])
    return dict(found)
