"""The frames of a capture one by one, each with its verdict, and with the transfer that it turns out to belong to."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
import pyarrow as pa

from analyzer.facts.names import type_name
from analyzer.tables import ERROR, EVENTS, EXTENDED, VERDICTS
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.decode.engine import Batch
    from analyzer.filter.matcher import Matches
    from analyzer.rules.named_frames import NamedFrames
    from analyzer.views.colours.painter import FrameColours, Painter
    from analyzer.window.listed import ListedRows
    from analyzer.window.numbering import Numbering
    from dissectors import Registry
    from dissectors.kit import Array

MOST_HELD = 1 << 18  # frames that wait for their transfer to end
ERROR_FRAME = len(VERDICTS)  # stands for the verdict of what has none
_USED, _FOREIGN = (VERDICTS.index(name) for name in ("used", "foreign"))
_ERROR_FRAME = EVENTS.index("error frame")
_FIRST, _PLACE, _OF, _TYPE = range(4)
_RAW = ("t", "bus", "id", "flags", "data")  # columns of frames, as they are
_PLACE_OF_BUS = pa.uint16()


class ListedFrames(NamedTuple):
    """Rows of frames and error frames, in their order: a column each, of one length.

    `place` is from 0, null for an error frame; `number` null for what has none; `since` ns since the row before, null
    for the first one and without a time; `t`, `id`, `flags` and `data` as in the table of frames; `bus` is a place in
    `buses`, of an error frame without one the last; `verdict` a place in `VERDICTS`, or `ERROR_FRAME`. `transfer` is
    the number of the first frame of its transfer, `part` which of how many (`of`) frames of it this one is, `type` a
    place in `types`: null for a frame that belongs to none. `rules` name it, if anybody asks for rules; `colour` is the
    place of a colour rule or `NO_RULE`, if there are some.
    """

    rows: pa.RecordBatch
    buses: tuple[str, ...]
    types: list[str]

    def deltas(self) -> pa.Array:
        """Return the nanoseconds since the row before, shown or not: 0 for the first, null for a row without a time."""
        since, known = self.rows.column("since"), valid(self.rows.column("t"))
        return pa.array(np.where(valid(since), numbers(since), 0), mask=None if known.all() else ~known)


class FrameMatcher(Protocol):
    """Chooses frames of a list."""

    def feed(self, batch: Batch) -> Matches:
        """Take the next batch, and return what is chosen of it."""


class _Held:
    """Listed frames of a batch that are not given yet."""

    def __init__(self, batch: Batch, picked: ListedRows, errors: pa.RecordBatch | None) -> None:
        rows = np.asarray(picked.frames).astype(np.int64)
        table = batch.frames.take(pa.array(rows))
        self.places = rows + batch.first_frame
        self.verdict = numbers(table.column("verdict")).copy()
        self.belongs = np.full((4, len(rows)), -1, np.int64)  # first frame, which, of how many, index of the type
        self.table, self.buses, self.errors, self.given = table, (*batch.buses, ""), errors, 0
        self.wanted = np.ones((1, len(rows)), bool)
        self.colour = np.full((1, len(rows)), -1)

    def __len__(self) -> int:
        return len(self.places) - self.given

    def ready(self) -> int:
        """Return how many of its frames are known for good, from the first one on.

        What is foreign until now may be of a sender that proves itself later; an 11-bit identifier is of none.
        """
        open_ = (self.verdict == _USED) & (self.belongs[_OF] < 0)
        open_ |= (self.verdict == _FOREIGN) & ((numbers(self.table.column("flags")) & EXTENDED) != 0)
        open_[: self.given] = False
        return int(np.argmax(open_)) if open_.any() else len(self.places)

    def errors_before(self, place: int | None) -> pa.RecordBatch | None:
        """Take the error frames in front of a frame that are not given yet, all if none is named."""
        errors = self.errors
        if errors is None:
            return None
        behind = numbers(errors.column("behind"))
        count = len(errors) if place is None else int(np.searchsorted(behind, place, "right"))
        self.errors = errors.slice(count) if count < len(errors) else None
        return errors.slice(0, count) if count else None


class FrameRows:
    """Joins frames with transfers: `feed(batch, picked)` gives the rows that are known for good, `finish()` the rest.

    Args:
        registry: the types.
        numbering: of frames and error frames.
        wait: hold a frame back until its transfer has ended, or its sender has proven itself, `MOST_HELD` frames at
            most; otherwise the transfer of one that is still open is not named.
        most: rows to give in all, None for no end.
        named: the rules that name frames.
        matcher: chooses frames; all are given without one.
        painter: finds the colours of frames, if there are some.
    """

    def __init__(
        self,
        registry: Registry,
        numbering: Numbering,
        *,
        wait: bool = True,
        most: int | None = None,
        named: NamedFrames | None = None,
        matcher: FrameMatcher | None = None,
        painter: Painter | None = None,
    ) -> None:
        self._named, self._matcher, self._painter = named, matcher, painter
        self._registry, self._numbering, self._wait, self._left = registry, numbering, wait, most
        self._held: deque[_Held] = deque()
        self._types: list[str] = []
        self._index: dict[int, int] = {}
        self._last: int | None = None

    @property
    def marked(self) -> bool:
        """True if rows say which rules name them."""
        return self._named is not None

    @property
    def oldest(self) -> int | None:
        """The place of the first frame that is not given yet."""
        return next((int(held.places[held.given]) for held in self._held if len(held)), None)

    def feed(self, batch: Batch, picked: ListedRows) -> Iterator[ListedFrames]:
        """Take the next batch; `picked.frames` are all the frames to give, those of transfers, too."""
        matches = None if self._matcher is None else self._matcher.feed(batch)
        colours = None if self._painter is None else self._painter.frames(batch)
        self._held.append(_Held(batch, picked, self._errors(batch, picked.events, matches, colours)))
        if matches is not None:
            self._choose(batch, picked, matches)
        if colours is not None:
            self._paint(batch, picked, colours)
        self._join(batch)
        yield from self._given(self._release(everything=not self._wait))

    def finish(self) -> Iterator[ListedFrames]:
        """Give what still waits: the transfers of these frames are outside the window, or do not end."""
        yield from self._given(self._release(everything=True))

    def _given(self, tables: Iterator[ListedFrames]) -> Iterator[ListedFrames]:
        if self._left is None:
            yield from tables
            return
        while self._left:
            table = next(tables, None)
            if table is None:
                return
            rows = table.rows.slice(0, self._left)
            self._left -= len(rows)
            yield table._replace(rows=rows)

    def _choose(self, batch: Batch, picked: ListedRows, matches: Matches) -> None:
        """Note which frames are wanted: as ones without a transfer until theirs has ended."""
        self._held[-1].wanted = matches.frames[np.asarray(picked.frames)][None]
        places, wanted = matches.members
        late = numbers(batch.settled.column("frame")).astype(np.int64)
        for held in self._held:
            if len(late):
                _put(held.places, late, held.wanted, matches.settled[None])
            if len(places):  # last, as it may be what has settled them
                _put(held.places, places, held.wanted, wanted[None])

    def _paint(self, batch: Batch, picked: ListedRows, colours: FrameColours) -> None:
        """Note the colours of frames, likewise."""
        self._held[-1].colour = colours.frames[np.asarray(picked.frames)][None]
        late = numbers(batch.settled.column("frame")).astype(np.int64)
        for held in self._held:
            if len(late):
                _put(held.places, late, held.colour, colours.settled[None])
            if len(colours.places):
                _put(held.places, colours.places, held.colour, colours.members[None])

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

    def _release(self, *, everything: bool) -> Iterator[ListedFrames]:
        while self._held:
            held = self._held[0]
            full = sum(map(len, self._held)) > MOST_HELD
            ready = len(held.places) if everything or full else held.ready()
            table = self._table(held, ready)
            if len(table.rows):
                yield table
            if ready < len(held.places):
                return
            self._held.popleft()

    def _table(self, held: _Held, stop: int) -> ListedFrames:
        """Return the frames up to `stop` with the error frames among them; all of these behind the last frame."""
        span = slice(held.given, stop)
        held.given = stop
        places, known = held.places[span], held.belongs[_OF, span] > 0
        first, part, of, kind = (held.belongs[k, span] for k in (_FIRST, _PLACE, _OF, _TYPE))
        columns = {name: held.table.column(name).slice(span.start, len(places)) for name in _RAW}
        columns["bus"] = columns["bus"].cast(_PLACE_OF_BUS)
        columns |= {
            "place": pa.array(places), "number": pa.array(self._numbering.of_all(places)),
            "verdict": pa.array(held.verdict[span]),
            "transfer": pa.array(self._numbering.of_all(np.where(known, first, 0)), mask=~known),
            **{n: pa.array(c, mask=~known) for n, c in (("part", part), ("of", of), ("type", kind))},
        }  # fmt: skip
        if self._matcher is not None:
            columns["wanted"] = pa.array(held.wanted[0, span])
        if self._painter is not None:
            columns["colour"] = pa.array(held.colour[0, span])
        if self._named is not None:
            columns["rules"] = pa.array(self._rules(self._named, places), pa.list_(pa.string()))
        rows = pa.RecordBatch.from_pydict(columns)
        errors = held.errors_before(None if stop == len(held.places) else int(places[-1]) if len(places) else -1)
        if errors is not None:
            rows = _among(rows, places, errors)
        rows = rows.append_column("since", self._since(rows.column("t")))
        if self._matcher is not None:
            rows = rows.filter(rows.column("wanted"))
        return ListedFrames(rows, held.buses, self._types)

    @staticmethod
    def _rules(named: NamedFrames, places: Array) -> list[tuple[str, ...]]:
        found = named.between(int(places[0]), int(places[-1])) if len(places) else {}
        return [tuple(found.get(place, ())) for place in places.tolist()] if found else [()] * len(places)

    def _since(self, times: pa.Array) -> pa.Array:
        """Return the nanoseconds since the row before that has a time."""
        known, t = valid(times), numbers(times)
        since = np.zeros(len(times), np.int64)
        told = t[known]
        if len(told):
            since[known] = np.diff(told, prepend=told[0] if self._last is None else self._last)
            known = known.copy()
            if self._last is None:
                known[np.argmax(known)] = False
            self._last = int(told[-1])
        return pa.array(since, mask=~known)

    def _errors(
        self, batch: Batch, picked: Array, matches: Matches | None, colours: FrameColours | None
    ) -> pa.RecordBatch | None:
        """Return the picked error frames: what they hold, and which place the frame behind each has."""
        events = batch.events
        if not len(picked):
            return None
        rows = np.flatnonzero(numbers(events.column("kind")) == _ERROR_FRAME)
        numbered = self._numbering.of_errors(batch.first_frame, batch.frames, events)
        before = np.searchsorted(numbers(batch.frames.column("line")), numbers(events.column("line"))[rows])
        wanted = np.isin(rows, np.asarray(picked))
        if not wanted.any():
            return None
        number = pa.array(numbered[wanted]) if len(numbered) else pa.nulls(int(wanted.sum()), pa.int64())
        some = events.take(pa.array(rows[wanted]))
        bus = np.where(valid(some.column("bus")), numbers(some.column("bus")), len(batch.buses))
        columns = {
            "behind": pa.array(batch.first_frame + before[wanted]), "number": number, "t": some.column("t"),
            "bus": pa.array(bus, _PLACE_OF_BUS), "id": some.column("class").cast(pa.uint32()),
            "data": some.column("data"),
        }  # fmt: skip
        if matches is not None:
            columns["wanted"] = pa.array(matches.events[rows[wanted]])
        if colours is not None:
            columns["colour"] = pa.array(colours.events[rows[wanted]])
        return pa.RecordBatch.from_pydict(columns)


def _among(rows: pa.RecordBatch, places: Array, errors: pa.RecordBatch) -> pa.RecordBatch:
    """Return the rows with error frames in front of the frames that stand behind them."""
    count = len(errors)
    known = {name: errors.column(name) for name in errors.schema.names if name != "behind"}
    known |= {"flags": pa.array(np.full(count, ERROR)), "verdict": pa.array(np.full(count, ERROR_FRAME))}
    added = [known[one.name].cast(one.type) if one.name in known else pa.nulls(count, one.type) for one in rows.schema]
    columns = [pa.concat_arrays(pair) for pair in zip(rows.columns, added, strict=True)]
    order = np.argsort(np.concatenate((places * 2 + 1, numbers(errors.column("behind")) * 2)), kind="stable")
    return pa.RecordBatch.from_arrays(columns, schema=rows.schema).take(pa.array(order))


def _put(places: Array, of: Array, into: Array, what: Array) -> None:
    """Write columns about frames into those of held frames, by place."""
    at = np.searchsorted(places, of)
    inside = (at < len(places)) & (places[np.minimum(at, len(places) - 1)] == of) if len(places) else at < 0
    into[:, at[inside]] = what[:, inside]
