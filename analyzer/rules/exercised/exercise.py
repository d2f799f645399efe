"""Words for what a capture exercised, as pages use them for what a rule needs.

`dissectors.keys.pages` lists the words.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.turning import Turning
from analyzer.tables import FD, KINDS, STATUSES, distinct
from dissectors.kit import Measures
from dissectors.schema import ArrayType, CompoundType

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors import Registry
    from dissectors.kit import Array, DecodedTable, Exercise, View
    from dissectors.schema import CompoundType as Layout
    from dissectors.schema import Type

MOST_PAIRED = 64  # tables whose order is followed
MOST_SENDERS = 1 << 16  # of bus, node and type; nodes that come later have one type each
_ANONYMOUS, _REQUEST = KINDS.index("anonymous"), KINDS.index("request")
_UNCHECKED, _BAD_CRC = STATUSES.index("unchecked"), STATUSES.index("bad crc")
_OF_TRANSFERS = "transfers", "anonymous", "services", "unknown types", "CRC failures", "multi-frame"


class Exercises:
    """Collects words over batches; those of types and packets of complete transfers with a good CRC.

    Args:
        registry: the types that the capture is decoded with.
        more: what dissectors bring along.
    """

    def __init__(self, registry: Registry, more: Iterable[type[Exercise]]) -> None:
        self._packets = registry.packets
        self._more = [kind() for kind in more]
        self._turning = Turning(registry)
        self._words: set[str] = set()
        self._kinds: dict[str, frozenset[str]] = {}  # words of each table
        self._seen: set[str] = set()  # tables
        self._spans: dict[str, tuple[int, int]] = {}  # the first and the last transfer of each, as far as it matters
        self._newest = 0  # the first transfer of the table that began last
        self._early: set[str] = set()  # those that have had none since
        self._buses: set[int] = set()
        self._senders: set[int] = set()

    def feed(self, view: View) -> None:
        """Add the next batch."""
        self._transport(view)
        known = len(self._spans)
        for name in view.tables():
            if name not in self._seen:
                self._first(view, name)
        if len(self._spans) > known:
            self._newest = max(first for first, _ in self._spans.values())
            self._early = {name for name, (_, last) in self._spans.items() if last < self._newest}
        if self._early:
            self._go_on(view)
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
        if not self._words.issuperset(_OF_TRANSFERS):
            self._note_transfers(view)
        if "several types" not in self._words:
            self._note_senders(view)

    def _note_transfers(self, view: View) -> None:
        transfers = view.transfers
        kinds = np.bincount(transfers.kind, minlength=len(KINDS))
        statuses = np.bincount(transfers.status, minlength=len(STATUSES))
        multi = "multi-frame" in self._words or transfers.has("crc_wire").any()
        services = kinds[_REQUEST:].any()
        seen = True, kinds[_ANONYMOUS], services, statuses[_UNCHECKED], statuses[_BAD_CRC], multi
        self._words.update(word for word, was in zip(_OF_TRANSFERS, seen, strict=True) if was)

    def _note_senders(self, view: View) -> None:
        transfers = view.transfers
        named = transfers.kind != _ANONYMOUS
        sender = transfers.bus.astype(np.int64) << 8 | transfers.src
        self._senders.update(np.unique(sender[named] << 32 | transfers.code[named]).tolist())
        if len({one >> 32 for one in self._senders}) < len(self._senders):
            self._words.add("several types")
        if "several types" in self._words or len(self._senders) > MOST_SENDERS:
            self._senders.clear()

    def _first(self, view: View, name: str) -> None:
        """Note a table that was not there before."""
        table, words = view.table(name), self._words_of(view, name)
        if table is None or words is None or not table.good:
            return
        self._seen.add(name)
        self._words |= words
        if len(self._spans) < MOST_PAIRED:
            numbers = _trusted(table)
            self._spans[name] = numbers.item(0), numbers.item(-1)

    def _go_on(self, view: View) -> None:
        """Note the last transfers of tables of which none came after the first one of the newest table."""
        for name in [*self._early]:
            table = view.table(name)
            if table is not None and table.good:
                first, last = self._spans[name]
                last = max(last, _trusted(table).item(-1))
                self._spans[name] = first, last
                if last >= self._newest:
                    self._early.remove(name)

    def _pairs(self) -> Iterator[str]:
        """Yield which tables came after which: the last one of B after the first one of A."""
        short = {name: self._packets[name].name if name in self._packets else name for name in self._spans}
        for before, (first, _) in self._spans.items():
            for after, (_, last) in self._spans.items():
                if before != after and first <= last:
                    yield f"pair:{short[before]}>{short[after]}"

    def _words_of(self, view: View, name: str) -> frozenset[str] | None:
        """Return the words of a table; None for one that nothing describes."""
        if name not in self._kinds:
            packet = self._packets.get(name)
            of = packet or view.definition(name)
            if of is None:
                return None
            own = (f"type:{name}", *_words(of.layout)) if packet is None else (f"packet:{packet.name}",)
            self._kinds[name] = frozenset(own)
        return self._kinds[name]


def _trusted(table: DecodedTable) -> Array:
    """Return the numbers of a table's trusted transfers."""
    numbers = table["transfer"]
    return numbers if table.good == len(table) else numbers[table.trusted]


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
