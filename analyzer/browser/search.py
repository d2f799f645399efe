"""Find in all rows: text of the list, bytes, or a filter; a thread looks, from where one is and round to there."""

from __future__ import annotations

import re
import threading
from typing import TYPE_CHECKING

import numpy as np

from analyzer.browser.chosen import matching_rows
from analyzer.browser.store.order import FRAME, TRANSFER, split
from analyzer.browser.store.segment import OpenSegment
from analyzer.views.listing import Listing
from analyzer.views.terminal import PLAIN
from analyzer.window.listed import ListedRows
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    import pyarrow as pa

    from analyzer.browser.store.cut import StoredFrames
    from analyzer.browser.store.store import TableStore
    from analyzer.filter.matcher import Matcher
    from analyzer.views.times import TimeFormat
    from dissectors import Registry
    from dissectors.kit import Array

    Look = Callable[[int], Array]

_BYTES = re.compile(r"^[0-9A-Fa-f]{2}(?:[ :]?[0-9A-Fa-f]{2})*$")
_LEAST_PAIRS = 2
_WIDTH = 500  # columns in which text is looked for
_NONE = np.zeros(0, np.uint32)


def bytes_of(text: str) -> bytes | None:
    """Return the bytes that a search names, such as `0a ff` or `0a:ff`; None for text."""
    if not _BYTES.match(text) or len(text) < _LEAST_PAIRS * 2 or not re.search(r"[ :]", text):
        return None
    return bytes.fromhex(text.replace(":", " "))


class Search:
    """Looks through the segments of a store; `look` gives the places in the list of one that are meant.

    Args:
        store: what is there.
        look: is asked for each segment once; in their order if it is `ordered`, else from `start` on and round.
    """

    def __init__(self, store: TableStore, text: str, look: Look, start: int, *, ordered: bool = False) -> None:
        self.text = text
        self._store, self._look, self._start, self._ordered = store, look, start, ordered
        self._found: dict[int, Array] = {}
        self._stop = threading.Event()
        self.problem: Exception | None = None
        self.done = False

    def begin(self) -> None:
        """Begin to look."""
        threading.Thread(target=self._work, name="find", daemon=True).start()

    def stop(self) -> None:
        """Look no further."""
        self._stop.set()

    def _work(self) -> None:
        count = len(self._store.segments)
        start = 0 if self._ordered else min(self._start, count)
        try:
            for at in (*range(start, count), *range(start)):
                if self._stop.is_set():
                    return
                self._found[at] = self._look(at)
        except Exception as error:  # noqa: BLE001 - whoever waits has to know
            self.problem = error
        self.done = True

    def next(self, segment: int, local: int, step: int) -> tuple[int, int] | str:
        """Return the next place behind one, or before it; "wait" while it is not known, "none" if there is none."""
        count = len(self._store.segments)
        for at in range(segment, count) if step > 0 else range(segment, -1, -1):
            rows = self._found.get(at)
            if rows is None:
                return "none" if self.done else "wait"
            if at == segment:
                rows = rows[rows > local] if step > 0 else rows[rows < local]
            if len(rows):
                return at, int(rows[0] if step > 0 else rows[-1])
        return "none"

    @property
    def count(self) -> int:
        """How many rows are found so far."""
        return sum(len(rows) for rows in list(self._found.values()))


def look_for_filter(store: TableStore, matcher: Matcher) -> Look:
    """Return what looks for rows that a filter selects, segments in their order."""
    return lambda at: matching_rows(store, at, matcher)


def look_for_bytes(store: TableStore, wanted: bytes) -> Look:
    """Return what looks for bytes in the payload of transfers, and in frames that form none."""

    def look(at: int) -> Array:
        opened = OpenSegment(store.segments[at])
        kinds, index = split(opened.column("rows", "key"))
        holds = np.zeros(len(kinds), bool)
        for kind, table, column in ((TRANSFER, "transfers", "payload"), (FRAME, "frames", "data")):
            of = kinds == kind
            if of.any():
                one = opened.table(table).column(column)
                found = np.zeros(len(one), bool)
                found[list(_rows_with(one, wanted))] = True
                holds[of] = found[index[of]]
        return np.flatnonzero(holds).astype(np.uint32)

    return look


def _rows_with(column: pa.Array, wanted: bytes) -> Iterator[int]:
    """Yield the cells that have these bytes, which do not go from one to the next."""
    _, ends, data = column.buffers()
    if data is None:
        return
    offsets = np.frombuffer(ends, np.int32, len(column) + 1, column.offset * 4)
    letters = data.to_pybytes()
    place = letters.find(wanted)
    while place >= 0:
        row = int(np.searchsorted(offsets, place, "right")) - 1
        if 0 <= row < len(column) and place + len(wanted) <= offsets[row + 1]:
            yield row
            place = letters.find(wanted, int(offsets[row + 1]))
        else:
            place = letters.find(wanted, place + 1)


def look_for_text(
    store: TableStore,
    registry: Registry,
    frames: StoredFrames,
    clock: TimeFormat,
    wanted: str,
    labels: Mapping[int, str],
) -> Look:
    """Return what looks for text in the lines of the list, labels of nodes among them, in small or capital letters."""
    lower = wanted.lower()
    called = [node for node, label in labels.items() if lower in label.lower()]

    def look(at: int) -> Array:
        batch = OpenSegment(store.segments[at]).batch
        kinds, index = split(OpenSegment(store.segments[at]).column("rows", "key"))
        listing = Listing(registry, clock, PLAIN, _WIDTH, frames=frames, foreign=True)
        shown = np.arange(len(batch.transfers))
        listing.feed(batch, ListedRows(shown, _NONE, _NONE, _NONE))
        told = np.array([lower in one.partition("\n")[0].lower() for one in listing.entries()], bool)
        if called and len(told):
            told |= np.isin(numbers(batch.transfers.column("src")), called)
        of = kinds == TRANSFER
        holds = np.zeros(len(kinds), bool)
        holds[of] = told[index[of]]
        for kind, name in ((1, "frames"), (2, "settled"), (3, "events")):
            rows = np.flatnonzero(kinds == kind)
            if len(rows):
                picked = ListedRows(_NONE, _NONE, _NONE, _NONE)._replace(**{name: index[rows]})
                listing.feed(batch, picked)
                lines = listing.before(None, titled=False).splitlines()
                holds[rows[: len(lines)]] = [lower in line.lower() for line in lines[: len(rows)]]
        return np.flatnonzero(holds).astype(np.uint32)

    return look
