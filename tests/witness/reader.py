"""A small reader of `candump -l` text that shares nothing with the analyzer: lines, identifiers, transfers.

Read downwards: a line becomes a `Frame`, the frames of a `Log` become `Transfer`s. Nothing is judged here beyond what
is needed to put transfers together; what is odd about a frame is noted with it, as is what its identifier and its tail
byte say (4.1.2, 4.1.3). Values are read by `witness.views`, packets by `witness.push_form`.
"""

from __future__ import annotations

import re
from binascii import crc_hqx
from bisect import bisect_right
from collections import defaultdict
from dataclasses import dataclass, field
from functools import cached_property

from kit import encode

SECOND = 10**9
TIMEOUT = 2 * SECOND  # of a transfer, from its first frame
Key = tuple[str, str, int, int, int | None]
KNOWN = {(kind.kind, kind.type_id): kind for kind in encode.TYPES.values()}
_BODY = r"(?:(R)(\d?)|#([0-9A-F])([0-9A-F]*)|([0-9A-F]*))"
_LINE = re.compile(r"\((\d+)\.(\d{6})\) (\w+) ([0-9A-F]{3}|[0-9A-F]{8})#" + _BODY)


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """`number` counts frames from 1 (error frames have 0), `line` counts lines from 1; `t` is in ns since 1970."""

    number: int
    line: int
    t: int
    bus: str
    id: int
    data: bytes
    extended: bool = True
    remote: bool = False
    error: bool = False
    fd: bool = False
    flags: int = 0
    dlc: int | None = None

    @property
    def priority(self) -> int:
        return self.id >> 24

    @property
    def service(self) -> bool:
        return bool(self.id & 0x80)

    @property
    def src(self) -> int:
        return self.id & 0x7F

    @property
    def dst(self) -> int | None:
        return self.id >> 8 & 0x7F if self.service else None

    @property
    def kind(self) -> str:
        """One of message, anonymous, request, response."""
        if self.service:
            return "request" if self.id & 0x8000 else "response"
        return "message" if self.src else "anonymous"

    @property
    def type_id(self) -> int:
        if self.service:
            return self.id >> 16 & 0xFF
        return self.id >> 8 & (0xFFFF if self.src else 3)

    @property
    def name(self) -> str:
        """The name of its type in encode.TYPES, or nothing."""
        kind = "message" if self.kind == "anonymous" else self.kind
        return KNOWN[kind, self.type_id].name if (kind, self.type_id) in KNOWN else ""

    @property
    def tailed(self) -> bool:
        """Can it be part of a transfer at all?"""
        return self.extended and not self.remote and not self.error and bool(self.data)

    @property
    def body(self) -> bytes:
        """The data without its tail byte."""
        return self.data[:-1]

    @property
    def start(self) -> bool:
        return bool(self.data[-1] & 0x80)

    @property
    def end(self) -> bool:
        return bool(self.data[-1] & 0x40)

    @property
    def toggle(self) -> int:
        return self.data[-1] >> 5 & 1

    @property
    def tid(self) -> int:
        return self.data[-1] & 31

    @property
    def session(self) -> tuple[str, str, int, int, int | None]:
        """All that a transfer's frames have in common beside the transfer ID."""
        return self.bus, self.kind, self.type_id, self.src, self.dst

    def same(self, other: Frame) -> bool:
        """Are the two equal bit by bit on the wire?"""
        return (self.id, self.data, self.fd) == (other.id, other.data, other.fd)


def parse(line: str, number: int, row: int) -> Frame:
    """One line; raises `ValueError` for what no recorder writes."""
    found = _LINE.fullmatch(line)
    if found is None:
        raise ValueError(f"line {row}: {line!r}")
    seconds, micro, bus, can_id, remote, length, flags, flexible, classic = found.groups()
    word = int(can_id, 16)
    error, extended = bool(len(can_id) == 8 and word & 0x2000_0000), len(can_id) == 8
    return Frame(
        0 if error else number,
        row,
        int(seconds) * SECOND + int(micro) * 1000,
        bus,
        word & 0x1FFF_FFFF,
        bytes.fromhex((classic if flags is None else flexible) or ""),
        extended=extended and not error,
        remote=remote is not None,
        error=error,
        fd=flags is not None,
        flags=int(flags or "0", 16),
        dlc=int(length) if length else None,
    )


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
