"""A small reader of `candump -l` text that shares nothing with the analyzer: lines, identifiers, transfers.

Read downwards: a line becomes a `Frame`, the frames of a `Log` become `Transfer`s. Nothing is judged here beyond what
is needed to put transfers together; what is odd about a frame is noted with it. Layouts and packets: `witness.fields`.
"""

from __future__ import annotations

from binascii import crc_hqx
from bisect import bisect_right
from collections import defaultdict
from dataclasses import dataclass, field
from functools import cached_property

from kit import encode

from witness.frame import SECOND, Frame, parse

TIMEOUT = 2 * SECOND  # of a transfer, from its first frame
Key = tuple[str, str, int, int, int | None]


@dataclass(slots=True, eq=False)
class Transfer:
    """Frames with one session and transfer ID, from a start on.

    `frames` are those that count, `copies` those dropped as copies (with the frame that each repeats), `broken` the
    first frame that does not continue the transfer and what follows it. `closed` is the frame that ended it: its last,
    or one that could not be without the end of this one. `status` is one of ok (the CRC is right, or one frame needs
    none), unchecked (no signature known), bad crc, interrupted, timed out, open.
    """

    frames: list[Frame]
    status: str = "open"
    copies: list[tuple[Frame, Frame]] = field(default_factory=list)
    broken: list[Frame] = field(default_factory=list)
    closed: Frame | None = None

    @property
    def first(self) -> Frame:
        return self.frames[0]

    @property
    def every(self) -> list[Frame]:
        """All of its frames by number, whatever they are worth."""
        if not self.copies and not self.broken:
            return self.frames
        return sorted((*self.frames, *(copy for copy, _ in self.copies), *self.broken), key=lambda frame: frame.number)

    @property
    def numbers(self) -> set[int]:
        return {frame.number for frame in self.every}

    @property
    def t(self) -> int:
        return self.first.t

    @property
    def name(self) -> str:
        return self.first.name

    @property
    def whole(self) -> bool:
        """Did all of it arrive, in order?"""
        return self.status in {"ok", "unchecked", "bad crc"}

    @property
    def many(self) -> bool:
        """Was it sent as several frames?"""
        return not self.first.end

    @property
    def joined(self) -> bytes:
        """The bytes of its frames without tails; a transfer of several frames has its CRC in front."""
        return b"".join(frame.body for frame in self.frames)

    @property
    def payload(self) -> bytes:
        """Without the CRC; padding of CAN FD is still there."""
        return self.joined[2:] if self.many else self.joined

    @property
    def crc(self) -> int | None:
        """As received."""
        return int.from_bytes(self.joined[:2], "little") if self.many else None

    @property
    def signature(self) -> int | None:
        return encode.TYPES[self.name].signature if self.name else None


def crc(payload: bytes, signature: int | None) -> int:
    """The transfer CRC; without a signature, the plain CRC-16-CCITT-FALSE."""
    seed = b"" if signature is None else signature.to_bytes(8, "little")
    return crc_hqx(seed + payload, 0xFFFF)


def crc_start(payload: bytes, value: int) -> int:
    """The CRC backwards: the value from which `payload` gives `value`."""
    for byte in reversed(payload):
        for _ in range(8):
            value = (value ^ 0x1021) >> 1 | 0x8000 if value & 1 else value >> 1
        value ^= byte << 8
    return value


class Log:
    """A capture: `lines` in order, `frames` without error frames, `errors` alone, and the transfers that they make."""

    def __init__(self, text: str) -> None:
        self.lines: list[Frame] = []
        number = 0
        for row, line in enumerate(text.splitlines(), 1):
            frame = parse(line, number + 1, row)
            number += not frame.error
            self.lines.append(frame)
        self.frames = [frame for frame in self.lines if not frame.error]
        self.errors = [frame for frame in self.lines if frame.error]

    def __getitem__(self, number: int) -> Frame:
        """The frame of a number."""
        return self.frames[number - 1]

    @cached_property
    def sessions(self) -> dict[Key, list[Frame]]:
        """All frames with tails, by what their transfers have in common."""
        found = defaultdict(list)
        for frame in self.frames:
            if frame.tailed:
                found[frame.session].append(frame)
        return dict(found)

    @cached_property
    def _read(self) -> tuple[list[Transfer], list[Frame]]:
        transfers, orphans = [], []
        for frames in self.sessions.values():
            session = Session()
            for frame in frames:
                session.feed(frame)
            session.finish(self.frames[-1])
            transfers += session.transfers
            orphans += session.orphans
        return sorted(transfers, key=lambda t: t.first.number), sorted(orphans, key=lambda f: f.number)

    @property
    def transfers(self) -> list[Transfer]:
        """By their first frame."""
        return self._read[0]

    @property
    def orphans(self) -> list[Frame]:
        """Frames that belong to no transfer: neither a start nor an open transfer of their ID."""
        return self._read[1]

    def during(self, transfer: Transfer) -> list[Frame]:
        """The frames of its session behind its first one, while it was open."""
        frames, end = self.sessions[transfer.first.session], transfer.closed or self.frames[-1]
        since = bisect_right(frames, transfer.first.number, key=_number)
        found = frames[since : bisect_right(frames, end.number, key=_number)]
        return found if transfer.status != "timed out" else [f for f in found if f.t - transfer.t <= TIMEOUT]

    @cached_property
    def by_session(self) -> dict[Key, list[Transfer]]:
        found = defaultdict(list)
        for transfer in self.transfers:
            found[transfer.first.session].append(transfer)
        return dict(found)

    def of(self, *names: str) -> list[Transfer]:
        """The transfers of these types that arrived whole, their CRC right."""
        return [transfer for transfer in self.transfers if transfer.name in names and transfer.status == "ok"]


def _number(frame: Frame) -> int:
    return frame.number


class Session:
    """Frames of one session in order; one place for each transfer ID."""

    def __init__(self) -> None:
        self.transfers: list[Transfer] = []
        self.orphans: list[Frame] = []
        self._open: dict[int, Transfer] = {}
        self._last: tuple[Frame, Transfer] | None = None

    def feed(self, frame: Frame) -> None:
        self.finish(frame)
        if self._last is not None and frame.same(self._last[0]) and not (frame.start and frame.end):
            before, transfer = self._last
            transfer.copies.append((frame, before))
            return
        transfer = self._open.get(frame.tid)
        if frame.start:
            transfer = self._begin(frame)
        elif transfer is not None:
            self._go_on(frame, transfer)
        else:
            self.orphans.append(frame)
        self._last = None if transfer is None else (frame, transfer)

    def finish(self, now: Frame) -> None:
        """Transfers that began too long ago are over."""
        for tid, transfer in list(self._open.items()):
            if now.t - transfer.t > TIMEOUT:
                self._close(tid, "interrupted" if transfer.broken else "timed out", now)

    def _begin(self, frame: Frame) -> Transfer:
        if frame.tid in self._open:
            self._close(frame.tid, "interrupted", frame)
        started = self._open[frame.tid] = Transfer([frame])
        self.transfers.append(started)
        if frame.end:
            self._close(frame.tid, "ok", frame)
        return started

    def _go_on(self, frame: Frame, transfer: Transfer) -> None:
        if transfer.broken or frame.toggle == transfer.frames[-1].toggle:
            transfer.broken.append(frame)
        else:
            transfer.frames.append(frame)
        if frame.end:
            self._close(frame.tid, "interrupted" if transfer.broken else _verdict(transfer), frame)

    def _close(self, tid: int, status: str, at: Frame) -> None:
        transfer = self._open.pop(tid)
        transfer.status, transfer.closed = status, at


def _verdict(transfer: Transfer) -> str:
    if transfer.signature is None:
        return "unchecked"
    return "ok" if crc(transfer.payload, transfer.signature) == transfer.crc else "bad crc"
