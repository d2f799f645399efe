"""Proofs of CAN-001 to CAN-020: what stands in single frames, and whose they are."""

from __future__ import annotations

from collections import Counter, defaultdict
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

from kit import encode

from witness.reader import KNOWN, crc

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from witness.reader import Frame, Key, Log, Transfer
    from witness.views import Found

LOWEST = 31
DOCUMENT = {"RawCommand", "ParamCfg", "ESCStatus", "PUSHSCI", "PUSHCAN", "ParamGet"}
OF_ESCS = {"ESCStatus", "PUSHCAN", "ParamGet"}
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


def where(log: Log, wrong: Callable[[Frame], bool]) -> Found:
    return [{frame.number} for frame in log.frames if wrong(frame)]


def grouped(frames: Iterable[Frame], by: Callable[[Frame], object]) -> Found:
    found = defaultdict(set)
    for frame in frames:
        found[by(frame)].add(frame.number)
    return list(found.values())


def legal(frame: Frame) -> bool:
    """A frame with 29 bits whose ID is that of a known type."""
    return frame.extended and known(frame)


def find_can_001(log: Log) -> Found:
    return where(log, lambda frame: not frame.extended)


def find_can_002(log: Log) -> Found:
    return where(log, lambda frame: frame.remote and legal(frame))


def find_can_003(log: Log) -> Found:
    return where(log, lambda frame: frame.fd or len(frame.data) > 8)


def find_can_004(log: Log) -> Found:
    """Lines, not frames: error frames have no number."""
    return [{frame.line} for frame in log.errors]


def find_can_005(log: Log) -> Found:
    return where(log, lambda frame: not frame.data and not frame.remote and legal(frame))


def find_can_006(log: Log) -> Found:
    return where(log, lambda frame: frame.service and frame.dst == 0 and legal(frame))


def find_can_007(log: Log) -> Found:
    return where(log, lambda frame: frame.service and frame.src == 0 and legal(frame))


def find_can_008(log: Log) -> Found:
    return where(log, lambda frame: frame.kind == "anonymous" and legal(frame))


def find_can_009(log: Log) -> Found:
    return where(log, lambda frame: _anonymous(frame) and not _alone(frame))


def _anonymous(frame: Frame) -> bool:
    return not frame.id & 0xFF and frame.tailed and legal(frame)


def _alone(frame: Frame) -> bool:
    """Is it an anonymous transfer of one frame, as it must be?"""
    return _anonymous(frame) and frame.start and frame.end


def _discriminated(frame: Frame) -> bool:
    check, part = crc(frame.body, None), frame.id >> 10 & 0x3FFF
    return any(check >> low & 0x3FFF == part for low in range(3))


def find_can_010(log: Log) -> Found:
    return where(log, lambda frame: _alone(frame) and not _discriminated(frame))


def find_can_011(log: Log) -> Found:
    return where(
        log,
        lambda frame: frame.src in {126, 127} and legal(frame) and (frame.kind == "response" or frame.name in OF_ESCS),
    )


def find_can_012(log: Log) -> Found:
    return where(log, lambda frame: frame.service and frame.src == frame.dst and legal(frame))


def find_can_013(log: Log) -> Found:
    high = [f for f in log.frames if f.extended and f.priority != LOWEST and f.name in DOCUMENT]
    return grouped(high, lambda frame: (frame.name, frame.src))


def find_can_014(log: Log) -> Found:
    return [one.numbers for one in log.transfers if len({frame.priority for frame in one.every}) > 1]


def find_can_015(log: Log) -> Found:
    return [set().union(*(one.numbers for one in transfers)) for transfers in unknown(log).values()]


def find_can_016(log: Log) -> Found:
    mine = [frame for frame in log.frames if legal(frame) and (frame.kind, frame.type_id) == ("message", FOC_CTRL)]
    return grouped(mine, lambda frame: frame.src)


def find_can_017(log: Log) -> Found:
    """The document's own types all do so by design, and are left out."""
    ids = VENDORS - BY_DESIGN
    mine = [f for f in log.frames if f.kind == "message" and f.type_id in ids and legal(f)]
    return grouped(mine, lambda frame: frame.type_id)


def find_can_018(log: Log) -> Found:
    ours = trusted(log)
    foreign = [frame for key, frames in log.sessions.items() if key not in ours for frame in frames]
    return grouped(foreign, lambda frame: (frame.bus, frame.id))


def find_can_019(log: Log) -> Found:
    return where(log, lambda frame: len(frame.data) not in encode.DLC_LENGTHS if frame.fd else len(frame.data) > 8)


def find_can_020(log: Log) -> Found:
    found = []
    for one in log.transfers:
        key = (one.first.kind, one.first.type_id)
        if key in COLLISIONS and one.many and one.status not in {"interrupted", "timed out", "open"}:
            right = crc(one.payload, OTHERS[key]) == one.crc
            if not right and crc(one.payload, COLLISIONS[key]) == one.crc:
                found.append(one.numbers)
    return found
