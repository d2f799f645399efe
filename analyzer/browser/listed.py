"""The lines of the packet list: any rows of the store as `decode` writes them, with columns of one's own."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.browser.plain_numbers import plain_numbers
from analyzer.browser.store.cut import StoredFrames, cut_transfers
from analyzer.browser.store.order import EVENT, FRAME, SETTLED, TRANSFER
from analyzer.views.listing import Listing
from analyzer.views.terminal import PLAIN, display_width, escape, fit
from analyzer.views.times import TimeFormat
from analyzer.window.listed import ListedRows

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from analyzer.browser.colouring import RowColouring
    from analyzer.browser.own_columns import OwnColumns
    from analyzer.browser.store.store import ListRow, TableStore
    from analyzer.window.numbering import Numbering
    from dissectors import Registry

_TIME_AT = 11  # where the time stands in a line
_CONTEXT = 2  # transfers of a sender before its own that tell what has changed
_NONE = np.zeros(0, np.int64)
_LOOKED_AT = 4096  # frames that tell how many decimals times have
_DELTAS = ("d", "dd")
_MOST_LABEL = 12  # columns


class ListLine(NamedTuple):
    """A line of the list; `codes` are the colours of a rule, `broken` marks what is none of a good transfer."""

    text: str
    codes: str = ""
    broken: bool = False


class ListPages:
    """Writes rows of a store.

    Args:
        store: what is there.
        registry: the types.
        numbering: of frames.
        colouring: colours of rows.
        labels: what nodes are called.
    """

    def __init__(
        self, store: TableStore, registry: Registry, numbering: Numbering, colouring: RowColouring,
        labels: Mapping[int, str] | None = None,
    ) -> None:  # fmt: skip
        self._store, self._registry, self._numbering, self._colouring = store, registry, numbering, colouring
        self._labels = {node: escape(label) for node, label in (labels or {}).items()}
        self._label = min(max(map(display_width, self._labels.values()), default=-1), _MOST_LABEL) + 1
        self._frames = StoredFrames(store)
        self.mode = "r"
        self.numbers = False  # in place of names
        self.zero: int | None = None  # a time reference in place of the first frame
        self.columns: OwnColumns | None = None
        self._first: tuple[int | None, int | None] = None, None
        self._head = ""

    def clock(self) -> TimeFormat:
        """Return what writes times now."""
        mode = "r" if self.mode in _DELTAS else self.mode
        zero, digits = self._settled()
        clock = TimeFormat(mode, zero if self.zero is None else self.zero, digits)
        clock.signed = self.zero is not None
        return clock

    def _settled(self) -> tuple[int | None, int | None]:
        """Return the time that relative ones count from, and the decimals of all, as the first frames settle them."""
        if self._first == (None, None) and self._store.segments:
            clock = TimeFormat("r", self._store.segments[0].zero)
            clock.start(self._store.opened(0).table("frames").slice(0, _LOOKED_AT))
            self._first = clock.zero, clock.digits
        return self._first

    def head(self, width: int) -> str:
        """Return the names of the columns, after the lines below them."""
        return fit(self._head, width)

    @property
    def info(self) -> int:
        """Where what a row says begins, after the lines below it."""
        return max(0, self._head.find("Info"))

    def column_at(self, x: int) -> str:
        """Return the column that a place in a line is in: number, time, src, dst, type, id, info or a field's name."""
        head = self._head
        source, kind, info = head.find("Src"), head.find("Type"), head.find("Info")
        ends = (
            (_TIME_AT - 1, "number"), (source - 1, "time"), (source + 3, "src"), (source + 7, "dst"), (kind, "info"),
            (head.find(" ID") - 1, "type"), (head.find(" ID") + 4, "id"),
        )  # fmt: skip
        for end, name in ends:
            if x < end:
                return name
        own = () if self.columns is None else self.columns.names
        at = (x - info) // (self.columns.width // len(own)) if own and self.columns is not None else -1
        at += len(own)
        return own[at] if 0 <= at < len(own) else "info"

    def lines(self, rows: Sequence[ListRow], width: int, before: Sequence[int | None] = ()) -> list[ListLine]:
        """Return the line of each row; `before` are the times of the rows that deltas are counted from."""
        beside = 0 if self.columns is None else self.columns.width
        label = 0 if self.numbers else self._label
        clock = self.clock()
        listing = self._listing(clock, max(20, width - beside - label))
        found: dict[int, str] = {}
        self._transfers(listing, rows, found)
        for kind, name in ((FRAME, "frames"), (SETTLED, "settled"), (EVENT, "events")):
            self._others(listing, rows, kind, name, found)
        codes = self._codes(rows)
        info, kind = self._head.find("Info"), self._head.find("Type")
        cells = None if self.columns is None else self.columns.cells(rows)
        lines = []
        for k, row in enumerate(rows):
            text = found.get(k, "")
            if self.mode in _DELTAS:
                text = self._delta(text, clock, self._store.time(row), before[k] if k < len(before) else None)
            if cells is not None and info > 0:
                text = _spliced(text, info, cells[k], beside)
            if label and kind > 0:
                text = _spliced(text, kind, self._called(row), label)
            lines.append(ListLine(fit(text, width), codes[k], text[:1] in ("x", "!")))
        if self.columns is not None and info > 0:
            self._head = _spliced(self._head, info, self.columns.heads(), beside)
        if label and kind > 0:
            self._head = _spliced(self._head, kind, "Label", label)
        return lines

    def _called(self, row: ListRow) -> str:
        """Return what the sender of a transfer is called, empty if it has no label."""
        if row.kind != TRANSFER:
            return ""
        source = self._store.opened(row.segment).column("transfers", "src")[row.entry]
        return self._labels.get(int(source), "")

    def _listing(self, clock: TimeFormat, width: int) -> Listing:
        """Return a list that knows nothing of other rows."""
        listing = Listing(
            self._registry, clock, PLAIN, width, frames=self._frames, numbering=self._numbering, foreign=True
        )
        self._head = ""
        return listing

    def _transfers(self, listing: Listing, rows: Sequence[ListRow], found: dict[int, str]) -> None:
        at = {self._number(row): k for k, row in enumerate(rows) if row.kind == TRANSFER}
        batch = cut_transfers(self._store, sorted(self._with_context(at)))
        if not len(batch.transfers):
            return
        numbered = sorted(self._with_context(at))
        shown = np.arange(len(numbered))
        listing.feed(batch, ListedRows(shown, _NONE, _NONE, _NONE))
        first = listing.places()
        self._head = listing.before(first[0] if first else None).rstrip("\n")
        lines = [entry.partition("\n")[0] for entry in listing.entries()]
        if self.numbers:
            lines = list(map(self._in_numbers, lines, plain_numbers(batch, self._registry)))
        for number, line in zip(numbered, lines, strict=True):
            if number in at:
                found[at[number]] = line

    def _in_numbers(self, line: str, said: tuple[str, str]) -> str:
        """Return a line with numbers in place of the name of its type, and of what it says."""
        begin, ends, info = (self._head.find(name) for name in ("Type", " ID", "Info"))
        if not 0 < begin < ends < info:
            return line
        called, values = said
        changed = f"{line[:begin]}{fit(called, ends - begin):<{ends - begin}}{line[ends:]}"
        return f"{changed[:info]:<{info}}{values}" if values else changed

    def _with_context(self, numbers: dict[int, int]) -> set[int]:
        """Return transfers, and those before them of the same senders."""
        every, edge = set(numbers), set(numbers)
        for _ in range(_CONTEXT):
            edge = {one for number in edge if (one := self._before(number)) >= 0} - every
            every |= edge
        return every

    def _before(self, number: int) -> int:
        at = self._store.segment_of_transfer(number)
        if at is None:
            return -1
        before = self._store.opened(at).column("before", "before")
        return int(before[number - self._store.segments[at].first_transfer])

    def _others(self, listing: Listing, rows: Sequence[ListRow], kind: int, name: str, found: dict[int, str]) -> None:
        """Write the rows that are no transfers, a segment at a time."""
        places = [k for k, row in enumerate(rows) if row.kind == kind]
        for segment in dict.fromkeys(rows[k].segment for k in places):
            some = [k for k in places if rows[k].segment == segment]
            index = np.array([rows[k].entry for k in some], np.int64)
            picked = ListedRows(_NONE, _NONE, _NONE, _NONE)._replace(**{name: index})
            listing.feed(self._store.opened(segment).batch, picked)
            text = listing.before(None)
            lines = text.splitlines()
            if len(lines) > len(some):  # with the header, once
                self._head = lines.pop(0)
            order = sorted(range(len(some)), key=lambda n: rows[some[n]].place)
            for n, line in zip(order, lines, strict=False):
                found[some[n]] = line

    def _codes(self, rows: Sequence[ListRow]) -> list[str]:
        codes = [""] * len(rows)
        for segment, kind in dict.fromkeys((row.segment, row.kind) for row in rows):
            some = [k for k, row in enumerate(rows) if (row.segment, row.kind) == (segment, kind)]
            for k, code in zip(some, self._colouring.codes(segment, kind, [rows[k].entry for k in some]), strict=True):
                codes[k] = code
        return codes

    def _delta(self, text: str, clock: TimeFormat, t: int | None, before: int | None) -> str:
        width = max(9, self._head.find("Src", _TIME_AT) - 1 - _TIME_AT) if "Src" in self._head else 9
        told = "" if t is None else clock.seconds(0 if before is None else t - before)
        return f"{text[:_TIME_AT]}{told:>9}{text[_TIME_AT + 9 :]}" if width >= 9 else text

    def _number(self, row: ListRow) -> int:
        return self._store.segments[row.segment].first_transfer + row.entry


def _spliced(text: str, at: int, cells: str, width: int) -> str:
    """Put cells in front of what a row says."""
    if display_width(text) < at:
        text = text.ljust(at)
    return f"{text[:at]}{fit(cells, width):<{width}}{text[at:]}"
