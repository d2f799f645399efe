"""The frames of a capture one by one, each with its verdict, and with the transfer that it turns out to belong to."""

from __future__ import annotations

from collections import deque
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.facts.names import type_name
from analyzer.tables import ERROR, EVENTS, VERDICTS, raw_times
from analyzer.views.frames.window import RawFrame
from dissectors.kit.cells import numbers, pylist, valid

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.decode.engine import Batch
    from analyzer.rules.named_frames import NamedFrames
    from analyzer.window.listed import ListedRows
    from analyzer.window.numbering import Numbering
    from dissectors import Registry
    from dissectors.kit import Array

MOST_HELD = 1 << 18  # frames that wait for their transfer to end
_USED = VERDICTS.index("used")
_ERROR_FRAME = EVENTS.index("error frame")
_FIRST, _PLACE, _OF, _TYPE = range(4)


class FrameRow(NamedTuple):
    """A frame, or an error frame.

    `place` is from 0, None for an error frame; `number` None for what has none; `since` ns since the row before;
    `transfer` the number of the first frame of its transfer, `part` which of how many frames of it this one is;
    `rules` name it.
    """

    place: int | None
    number: int | None
    since: int | None
    bus: str
    frame: RawFrame
    verdict: str
    type: str = ""
    transfer: int | None = None
    part: tuple[int, int] | None = None
    rules: tuple[str, ...] = ()


class _Held:
    """ListedRows frames of a batch that are not given yet."""

    def __init__(self, batch: Batch, picked: ListedRows, errors: list[tuple[int, int | None, str, RawFrame]]) -> None:
        rows = np.asarray(picked.frames).astype(np.int64)
        table = batch.frames.take(rows)
        self.places = rows + batch.first_frame
        self.verdict = numbers(table.column("verdict")).copy()
        self.belongs = np.full((4, len(rows)), -1, np.int64)  # first frame, which, of how many, index of the type
        columns = ("id", "data", "bus", "t", "flags")
        self.frames = [RawFrame(*row) for row in zip(*(pylist(table.column(c)) for c in columns), strict=True)]
        self.buses, self.errors, self.given = batch.buses, deque(errors), 0

    def __len__(self) -> int:
        return len(self.places) - self.given

    def ready(self) -> int:
        """Return how many of its frames are known for good, from the first one on."""
        open_ = (self.verdict == _USED) & (self.belongs[_OF] < 0)
        open_[: self.given] = False
        return int(np.argmax(open_)) if open_.any() else len(self.places)


class FrameRows:
    """Joins frames with transfers: `feed(batch, picked)` gives the rows that are known for good, `finish()` the rest.

    Args:
        registry: the types.
        numbering: of frames and error frames.
        wait: hold a frame back until its transfer has ended, `MOST_HELD` frames at most; otherwise the transfer of one
            that is still open is not named.
        most: rows to give in all, None for no end.
        named: the rules that name frames.
    """

    def __init__(
        self,
        registry: Registry,
        numbering: Numbering,
        *,
        wait: bool = True,
        most: int | None = None,
        named: NamedFrames | None = None,
    ) -> None:
        self._named = named
        self._registry, self._numbering, self._wait, self._left = registry, numbering, wait, most
        self._held: deque[_Held] = deque()
        self._types: list[str] = []
        self._index: dict[int, int] = {}
        self._last: int | None = None

    @property
    def marked(self) -> bool:
        """True if rows say which rules name them."""
        return self._named is not None

    def feed(self, batch: Batch, picked: ListedRows) -> Iterator[FrameRow]:
        """Take the next batch; `picked.frames` are all the frames to give, those of transfers, too."""
        self._held.append(_Held(batch, picked, self._errors(batch, picked.events)))
        self._join(batch)
        yield from self._given(self._release(everything=not self._wait))

    def finish(self) -> Iterator[FrameRow]:
        """Give what still waits: the transfers of these frames are outside the window, or do not end."""
        yield from self._given(self._release(everything=True))

    def _given(self, rows: Iterator[FrameRow]) -> Iterator[FrameRow]:
        for row in rows if self._left is None else islice(rows, self._left):
            self._left = None if self._left is None else self._left - 1
            yield row

    def _join(self, batch: Batch) -> None:
        table = batch.transfers
        frames = table.column("frame")
        settled = [numbers(batch.settled.column(name)).astype(np.int64) for name in ("frame", "verdict")]
        if len(table):
            offsets = np.frombuffer(frames.buffers()[1], np.int32)[: len(table) + 1].astype(np.int64)
            places, sizes = numbers(frames.values)[offsets[0] : offsets[-1]].astype(np.int64), np.diff(offsets)
            owner = np.repeat(np.arange(len(table)), sizes)
            start = offsets[:-1] - offsets[0]
            what = np.stack((
                places[np.minimum(start, len(places) - 1)][owner],
                np.arange(len(places)) - start[owner] + 1,
                sizes[owner],
                self._type_of(batch)[owner],
            ))  # fmt: skip
        for held in self._held:
            if len(table):
                _put(held.places, places, held.belongs, what)
            if len(settled[0]):
                _put(held.places, settled[0], held.verdict[None], settled[1][None])

    def _type_of(self, batch: Batch) -> Array:
        """Return for each transfer the index of its type's name."""
        variant, kind, type_id = (
            numbers(batch.transfers.column(n)).astype(int) for n in ("variant", "kind", "type_id")
        )
        codes, inverse = np.unique(variant << 24 | kind << 16 | type_id, return_inverse=True)
        for code in codes.tolist():
            if code not in self._index:
                key = code >> 16 & 0xFF, code & 0xFFFF
                self._index[code] = len(self._types)
                self._types.append(type_name(self._registry.message(*key, code >> 24), *key))
        return np.array([self._index[code] for code in codes.tolist()], np.int64)[inverse]

    def _release(self, *, everything: bool) -> Iterator[FrameRow]:
        while self._held:
            held = self._held[0]
            full = sum(map(len, self._held)) > MOST_HELD
            ready = len(held.places) if everything or full else held.ready()
            yield from self._rows(held, ready)
            if ready < len(held.places):
                return
            self._held.popleft()

    def _rows(self, held: _Held, stop: int) -> Iterator[FrameRow]:
        places = held.places[held.given : stop]
        numbered = self._numbering.of_all(places).tolist()
        named = self._named.between(int(places[0]), int(places[-1])) if self._named and len(places) else {}
        for row, number in zip(range(held.given, stop), numbered, strict=True):
            place = int(held.places[row])
            yield from self._error_rows(held, place)
            frame = held.frames[row]
            belongs = held.belongs[:, row].tolist()
            of = belongs[_OF] > 0
            yield FrameRow(
                place, number, self._since(frame.t), held.buses[frame.bus], frame, VERDICTS[held.verdict[row]],
                self._types[belongs[_TYPE]] if of else "",
                self._numbering.of(belongs[_FIRST]) if of else None,
                (belongs[_PLACE], belongs[_OF]) if of else None, tuple(named.get(place, ())),
            )  # fmt: skip
        held.given = stop
        if stop == len(held.places):
            yield from self._error_rows(held, None)

    def _error_rows(self, held: _Held, place: int | None) -> Iterator[FrameRow]:
        while held.errors and (place is None or held.errors[0][0] <= place):
            _, number, bus, frame = held.errors.popleft()
            yield FrameRow(None, number, self._since(frame.t), bus, frame, "error frame")

    def _since(self, t: int | None) -> int | None:
        if t is None:
            return None
        since, self._last = None if self._last is None else t - self._last, t
        return since

    def _errors(self, batch: Batch, picked: Array) -> list[tuple[int, int | None, str, RawFrame]]:
        """Return the picked error frames: place of the frame behind, number, bus, and what they hold."""
        events = batch.events
        if not len(picked):
            return []
        kinds = numbers(events.column("kind"))
        rows = np.flatnonzero(kinds == _ERROR_FRAME)
        count = self._numbering.of_errors(batch.first_frame, batch.frames, events).tolist() or [None] * len(rows)
        before = np.searchsorted(numbers(batch.frames.column("line")), numbers(events.column("line"))[rows])
        times, data, has_bus = raw_times(events.column("t")), pylist(events.column("data")), valid(events.column("bus"))
        bus, kind = numbers(events.column("bus")), numbers(events.column("class"))
        found, wanted = [], set(np.asarray(picked).tolist())
        for row, number, place in zip(rows.tolist(), count, before.tolist(), strict=True):
            if row in wanted:
                name = batch.buses[bus[row]] if has_bus[row] else ""
                frame = RawFrame(int(kind[row]), data[row] or b"", int(bus[row]), times[row], ERROR)
                found.append((batch.first_frame + place, number, name, frame))
        return found


def _put(places: Array, of: Array, into: Array, what: Array) -> None:
    """Write columns about frames into those of held frames, by place."""
    at = np.searchsorted(places, of)
    inside = (at < len(places)) & (places[np.minimum(at, len(places) - 1)] == of) if len(places) else at < 0
    into[:, at[inside]] = what[:, inside]
