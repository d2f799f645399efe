"""Proofs of CAN-001 to CAN-020: what stands in single frames, and whose they are."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

from witness import trust
from witness.reader import crc

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from witness.frame import Frame
    from witness.reader import Log

Found = list[set[int]]
LOWEST = 31
FD_LENGTHS = {*range(9), 12, 16, 20, 24, 32, 48, 64}
DOCUMENT = {"RawCommand", "ParamCfg", "ESCStatus", "PUSHSCI", "PUSHCAN", "ParamGet"}
OF_ESCS = {"ESCStatus", "PUSHCAN", "ParamGet"}


def where(log: Log, wrong: Callable[[Frame], bool]) -> Found:
    return [{frame.number} for frame in log.frames if wrong(frame)]


def grouped(frames: Iterable[Frame], by: Callable[[Frame], object]) -> Found:
    found = defaultdict(set)
    for frame in frames:
        found[by(frame)].add(frame.number)
    return list(found.values())


def legal(frame: Frame) -> bool:
    """A frame with 29 bits whose ID is that of a known type."""
    return frame.extended and trust.known(frame)


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
    return [set().union(*(one.numbers for one in transfers)) for transfers in trust.unknown(log).values()]


def find_can_016(log: Log) -> Found:
    mine = [
        frame for frame in log.frames if legal(frame) and (frame.kind, frame.type_id) == ("message", trust.FOC_CTRL)
    ]
    return grouped(mine, lambda frame: frame.src)


def find_can_017(log: Log) -> Found:
    """The document's own types all do so by design, and are left out."""
    ids = trust.VENDORS - trust.BY_DESIGN
    mine = [f for f in log.frames if f.kind == "message" and f.type_id in ids and legal(f)]
    return grouped(mine, lambda frame: frame.type_id)


def find_can_018(log: Log) -> Found:
    ours = trust.trusted(log)
    foreign = [frame for key, frames in log.sessions.items() if key not in ours for frame in frames]
    return grouped(foreign, lambda frame: (frame.bus, frame.id))


def find_can_019(log: Log) -> Found:
    return where(log, lambda frame: len(frame.data) not in FD_LENGTHS if frame.fd else len(frame.data) > 8)


def find_can_020(log: Log) -> Found:
    found = []
    for one in log.transfers:
        key = (one.first.kind, one.first.type_id)
        if key in trust.COLLISIONS and one.many and one.status not in {"interrupted", "timed out", "open"}:
            right = crc(one.payload, trust.OTHERS[key]) == one.crc
            if not right and crc(one.payload, trust.COLLISIONS[key]) == one.crc:
                found.append(one.numbers)
    return found
