"""The CRC start value of types without a definition: one for all intact transfers of a type (4.3.1)."""

from __future__ import annotations

from binascii import crc_hqx
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.diagnosis.checksums import starts_of_all
from analyzer.rules.transfers.incomplete import corrupted
from analyzer.rules.transfers.lists import picked
from analyzer.tables import STATUSES
from dissectors.kit import Occurrence, Rule
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, Occurrences, Values, View

_UNCHECKED = STATUSES.index("unchecked")
_SERVICE = 2  # this kind and those above it
ENOUGH = 2  # transfers that agree
_FEW = 16  # transfers of which two need no majority
MOST_HELD = 64  # transfers of a type that wait until its value is known
MOST_TYPES = 1024
MOST_SENDERS = 4096
_SHOWN = 16  # frames kept of a sender


class _Sender(NamedTuple):
    bus: int
    src: int
    code: int


class _Seen(NamedTuple):
    """A transfer of an unknown type; `length` is that of its payload."""

    sender: _Sender
    t: int
    frames: tuple[int, ...]
    lines: tuple[str, ...]
    wire: int
    length: int
    start: int
    fd: bool


@dataclass(slots=True)
class _Type:
    """A type by what its transfers say. `value` is set once enough of them agree; until then they are held."""

    value: int | None = None
    total: int = 0
    counts: dict[int, int] = field(default_factory=dict)
    held: list[_Seen] = field(default_factory=list)

    def add(self, start: int) -> None:
        """Add one more transfer."""
        self.total += 1
        if start in self.counts or len(self.counts) < MOST_HELD:
            self.counts[start] = count = self.counts.get(start, 0) + 1
            # Among many different values two are equal by chance.
            if count >= ENOUGH and (self.total <= _FEW or 2 * count >= self.total):
                self.value = start


@dataclass(slots=True)
class _Tally:
    first: _Seen
    transfers: int = 0


class CrcStarts(Rule):
    """Finds each unknown type's value, counts the transfers that have it, and calls the others damaged."""

    rules = ("TRF-031", "TRF-010")

    def __init__(self) -> None:
        self._types: dict[tuple[bool, int], _Type] = {}
        self._tallies: dict[_Sender, _Tally] = {}

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield transfers with a CRC that no signature is known for."""
        t = view.transfers
        rows = (t.status == _UNCHECKED).nonzero()[0]
        if len(rows):
            rows = rows[t.has("crc_wire")[rows]]
        if not len(rows):
            return
        begins, data = t.raw
        ends, places = picked(begins, rows)
        starts = starts_of_all(t.crc_wire[rows].astype(np.int64), ends, np.frombuffer(data, np.uint8)[places])
        kinds = (t.kind[rows] >= _SERVICE).astype(np.int64) << 16 | t.type_id[rows]
        for kind in np.unique(kinds).tolist():
            here = kinds == kind
            key = bool(kind >> 16), kind & 0xFFFF
            if key in self._types or len(self._types) < MOST_TYPES:
                yield from self._add(view, self._types.setdefault(key, _Type()), rows[here], starts[here])

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield what each sender's transfers start from."""
        for sender, tally in self._tallies.items():
            start = tally.first.start
            names = view.types.starting_from(start)
            like = f", like {' or '.join(names)}" if names else ""
            values = {"crc_start": start, "transfers": tally.transfers, "like": like}
            yield _occurrence("TRF-031", tally.first, sender, view.type_name(sender.code), values)

    def _add(self, view: View, known: _Type, rows: Array, starts: Array) -> Iterator[Occurrences | Occurrence]:
        done = 0
        while known.value is None and done < len(rows):
            row, start = int(rows[done]), int(starts[done])
            if len(known.held) < MOST_HELD:
                known.held.append(_seen(view, row, start))
            known.add(start)
            done += 1
        if known.value is None:
            return
        value = known.value
        for seen in known.held:
            if seen.start == value:
                self._count(seen, 1)
            else:
                here = seen.wire ^ crc_hqx(bytes(seen.length), seen.start ^ value)  # a CRC is linear
                values = corrupted(seen.wire, here, seen.length, seen.frames, fd=seen.fd)
                yield _occurrence("TRF-010", seen, seen.sender, view.type_name(seen.sender.code), values)
        known.held.clear()
        rows, starts = rows[done:], starts[done:]
        fits = starts == value
        self._count_all(view, rows[fits], value)
        yield view.among_transfers("TRF-010", rows[~fits], lambda row: _crcs(view, row, value))

    def _count_all(self, view: View, rows: Array, start: int) -> None:
        t = view.transfers
        codes = (t.bus[rows].astype(np.int64) << 40) | (t.src[rows].astype(np.int64) << 32) | t.code[rows]
        _, first, counts = np.unique(codes, return_index=True, return_counts=True)
        for at, count in zip(first.tolist(), counts.tolist(), strict=True):
            self._count(_seen(view, int(rows[at]), start), count)

    def _count(self, seen: _Seen, count: int) -> None:
        if seen.sender in self._tallies or len(self._tallies) < MOST_SENDERS:
            self._tallies.setdefault(seen.sender, _Tally(seen)).transfers += count


def _seen(view: View, row: int, start: int) -> _Seen:
    t = view.transfers
    frames = tuple(t.frames(row)[:_SHOWN])
    sender = _Sender(int(t.bus[row]), int(t.src[row]), int(t.code[row]))
    wire, length = int(t.crc_wire[row]), int(t.length[row])
    return _Seen(sender, int(t.t[row]), frames, view.lines(frames), wire, length, start, bool(t.fd[row]))


def _crcs(view: View, row: int, value: int) -> Values:
    t = view.transfers
    payload = t.payload(row)
    return corrupted(int(t.crc_wire[row]), crc_hqx(payload, value), len(payload), t.frames(row), fd=bool(t.fd[row]))


def _occurrence(rule: str, seen: _Seen, sender: _Sender, name: str, values: Values) -> Occurrence:
    return Occurrence(
        rule=rule, t=seen.t, bus=sender.bus, node=sender.src or None, type=name, frames=seen.frames, lines=seen.lines,
        values=values,
    )  # fmt: skip
