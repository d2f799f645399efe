"""Words for what a capture exercised, as pages use them for what a rule needs, and counts of each type and code.

`dissectors.keys.pages` lists the words.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.turning import Turning
from analyzer.tables import FD, KINDS, STATUSES, distinct
from dissectors.kit import Measures
from dissectors.records import dataclass
from dissectors.schema import ArrayType, CompoundType, PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from dissectors import Registry
    from dissectors.kit import DecodedTable, Exercise, View
    from dissectors.schema import CompoundType as Layout
    from dissectors.schema import Note, Type

MOST_PAIRED = 64  # tables whose order is followed
MOST_SENDERS = 1 << 16  # of bus, node and type; nodes that come later have one type each
_ANONYMOUS, _REQUEST = KINDS.index("anonymous"), KINDS.index("request")
_UNCHECKED, _BAD_CRC = STATUSES.index("unchecked"), STATUSES.index("bad crc")
_WIDEST = 2  # bytes of a code that is counted


@dataclass(frozen=True, slots=True)
class _Kind:
    """Facts about a table: words of its layout, its columns of codes with the texts of these."""

    words: frozenset[str]
    codes: Mapping[str, Mapping[int, str]]


class Exercises:
    """Collects words over batches.

    `types` counts the rows of messages by table, `packets` those of packets, `values` the codes of fields with an
    enumeration, by their texts (a code without one by its number); all of complete transfers with a good CRC.

    Args:
        registry: the types that the capture is decoded with.
        more: what dissectors bring along.
    """

    def __init__(self, registry: Registry, more: Iterable[type[Exercise]]) -> None:
        self.types: dict[str, int] = {}
        self.packets: dict[str, int] = {}
        self.values: dict[str, dict[str, int]] = {}
        self._packets = registry.packets
        self._more = [kind() for kind in more]
        self._turning = Turning(registry)
        self._words: set[str] = set()
        self._kinds: dict[str, _Kind] = {}
        self._spans: dict[str, tuple[int, int]] = {}
        self._buses: set[int] = set()
        self._senders: set[int] = set()

    def feed(self, view: View) -> None:
        """Add the next batch."""
        self._transport(view)
        for name in view.tables():
            table = view.table(name)
            kind = self._kind(view, name)
            if table is not None and kind is not None:
                self._table(name, table, kind)
        self._turning.feed(view)
        for one in self._more:
            one.feed(view)

    def words(self) -> frozenset[str]:
        """Return what was there."""
        return frozenset(self._words.union(self._pairs(), *(one.words() for one in self._more)))

    def facts(self) -> dict[str, float]:
        """Return numbers of the whole capture, as dissectors offer them; ESCs of several vendors add up."""
        found = {name: value for one in self._more if isinstance(one, Measures) for name, value in one.facts().items()}
        if own := self._turning.facts():
            found["escs"] = found.get("escs", 0) + own["escs"]
            found["running_s"] = max(found.get("running_s", 0.0), own["running_s"])
        return found

    def _transport(self, view: View) -> None:
        frames, transfers = view.frames, view.transfers
        if len(frames):
            self._words.add("frames")
            if len(self._buses) < len(view.buses):
                self._buses.update(distinct(frames.bus))
            if int(np.bitwise_or.reduce(frames.flags)) & FD:
                self._words.add("fd")
        if len(self._buses) > 1:
            self._words.add("several interfaces")
        if not len(transfers):
            return
        kinds = np.bincount(transfers.kind, minlength=len(KINDS))
        statuses = np.bincount(transfers.status, minlength=len(STATUSES))
        seen = {
            "transfers": True,
            "anonymous": kinds[_ANONYMOUS],
            "services": kinds[_REQUEST:].any(),
            "unknown types": statuses[_UNCHECKED],
            "CRC failures": statuses[_BAD_CRC],
            "multi-frame": "multi-frame" in self._words or transfers.has("crc_wire").any(),
        }
        self._words.update(word for word, was in seen.items() if was)
        if "several types" not in self._words:
            self._note_senders(view)

    def _note_senders(self, view: View) -> None:
        transfers = view.transfers
        named = transfers.kind != _ANONYMOUS
        sender = transfers.bus.astype(np.int64) << 8 | transfers.src
        self._senders.update(np.unique(sender[named] << 32 | transfers.code[named]).tolist())
        if len({one >> 32 for one in self._senders}) < len(self._senders):
            self._words.add("several types")
        if "several types" in self._words or len(self._senders) > MOST_SENDERS:
            self._senders.clear()

    def _table(self, name: str, table: DecodedTable, kind: _Kind) -> None:
        trusted = table.trusted
        count = int(np.count_nonzero(trusted))
        if not count:
            return
        counts = self.packets if name in self._packets else self.types
        if name not in counts:
            word = f"packet:{self._packets[name].name}" if name in self._packets else f"type:{name}"
            self._words.update(kind.words, (word,))
        counts[name] = counts.get(name, 0) + count
        for column, texts in kind.codes.items():
            self._count(f"{name}.{column}", table, column, texts, whole=count == len(table))
        if name in self._spans or len(self._spans) < MOST_PAIRED:
            numbers = table["transfer"] if count == len(table) else table["transfer"][trusted]
            first, last = self._spans.get(name, (int(numbers[0]), 0))
            self._spans[name] = first, max(last, int(numbers[-1]))

    def _count(self, path: str, table: DecodedTable, column: str, texts: Mapping[int, str], *, whole: bool) -> None:
        codes = table[column] if column in table else np.empty(0)
        if codes.dtype.kind != "u" or codes.dtype.itemsize > _WIDEST:
            return
        valid = table.has(column)
        if not (whole and valid.all()):
            codes = codes[table.trusted & valid]
        counts = np.bincount(codes)
        seen = self.values.setdefault(path, {})
        for code in np.flatnonzero(counts).tolist():
            text = texts.get(code, str(code))
            seen[text] = seen.get(text, 0) + int(counts[code])

    def _pairs(self) -> Iterator[str]:
        """Yield which tables came after which: the last one of B after the first one of A."""
        short = {name: self._packets[name].name if name in self._packets else name for name in self._spans}
        for before, (first, _) in self._spans.items():
            for after, (_, last) in self._spans.items():
                if before != after and first <= last:
                    yield f"pair:{short[before]}>{short[after]}"

    def _kind(self, view: View, name: str) -> _Kind | None:
        if name not in self._kinds:
            of = self._packets.get(name) or view.definition(name)
            if of is None:
                return None
            words = frozenset() if name in self._packets else frozenset(_words(of.layout))
            self._kinds[name] = _Kind(words, dict(_codes(of.layout, of.notes)))
        return self._kinds[name]


def _words(layout: Layout) -> Iterator[str]:
    if layout.min_bits % 8 or layout.max_bits % 8:
        yield "padded types"
    stack: list[Type] = [layout]
    while stack:
        one = stack.pop()
        if isinstance(one, ArrayType):
            stack.append(one.element)
            if one.dynamic:
                yield "arrays"
        elif isinstance(one, CompoundType):
            stack += [member.type for member in one.fields]
            if one.union:
                yield "unions"
        elif one.kind in ("float", "void"):
            yield f"{one.kind}s"


def _codes(layout: Layout, notes: Mapping[str, Note]) -> Iterator[tuple[str, Mapping[int, str]]]:
    """Yield columns of codes that have texts."""
    for member in layout.fields:
        note = notes.get(member.name)
        if note is None or not isinstance(member.type, PrimitiveType):
            continue
        if note.enum:
            yield member.name, {**note.enum, **note.special}
        for part in note.parts:
            if part.enum:
                yield f"{member.name}.{part.name}", part.enum
