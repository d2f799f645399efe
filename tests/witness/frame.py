"""A line of `candump -l` as a frame, and what its identifier and its tail byte say (4.1.2, 4.1.3)."""

from __future__ import annotations

import re
from dataclasses import dataclass

from kit import encode

SECOND = 10**9
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
