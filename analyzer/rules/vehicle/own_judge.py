"""The rules of a vehicle file at work."""

from __future__ import annotations

import zlib
from copy import copy, deepcopy
from typing import TYPE_CHECKING, Self

import numpy as np

from analyzer.filter.context import BatchContext
from analyzer.filter.history import columns_of
from analyzer.filter.matcher import LaggedField
from analyzer.filter.memory import FilterMemory
from analyzer.filter.rowsets import TransferSet
from analyzer.filter.values import ByteSpans, CodedWords
from analyzer.rules.vehicle.at_hand import HandSet, HeldField, RowsAtHand, device_name, rows_at_hand
from analyzer.rules.vehicle.lasting import Demands, DemandWords, Event, Streaks
from analyzer.rules.vehicle.own_frames import FrameJudge
from analyzer.rules.vehicle.own_words import MOST_SHOWN, value_words
from dissectors.kit import NO_TIME, Occurrence
from dissectors.kit.cells import floats
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.filter.fields import FieldRef
    from analyzer.rules.vehicle.lasting import OpenDemand
    from analyzer.rules.vehicle.own import Clause, OwnRule, OwnRules
    from analyzer.rules.view import BatchView
    from dissectors import Registry
    from dissectors.kit import Array, Occurrences, Values

_SHOWN = ("table", "node", "transfer")


class OwnJudge:
    """Looks for what the rules of a vehicle file name; `words` are what of them a capture exercised."""

    def __init__(self, own: OwnRules, rules: Iterable[str], registry: Registry) -> None:
        wanted = set(rules)
        chosen = [one for one in own.rules if one.rule in wanted]
        self._frames = FrameJudge([one for one in chosen if one.when.frames], registry, own.labels or {})
        self._works = [_Work(one) for one in chosen if not one.when.frames]
        fields = [ref for work in self._works for ref in work.fields]
        self._memory = FilterMemory(
            registry, numbering=None, zero=None, labels=own.labels or {}, named=None, severities={}, frame_list=False,
            columns=columns_of(fields),
        )  # fmt: skip
        self._channels = any(ref.origin == "channel" for ref in fields)
        self._deltas = any((ref.origin, ref.column) == ("frame", "delta") for ref in fields)

    def __deepcopy__(self, _memo: object) -> Self:
        """Return one for what the end shows: what demands remember grows apart, the rest is shared."""
        found = copy(self)
        vars(found)["_works"] = [work.copy() for work in self._works]
        vars(found)["_frames"] = self._frames.copy()
        return found

    @property
    def words(self) -> frozenset[str]:
        """The demands that were answered, or not."""
        return frozenset(f"demand:{work.rule}" for work in self._works if work.decided)

    def feed(self, view: BatchView) -> Iterator[Occurrences | Occurrence]:
        """Return the breaches of the next batch."""
        yield from self._frames.feed(view)
        batch = view.batch
        if batch is None or not self._works:
            return
        self._memory.feed(batch)
        context = BatchContext(batch, self._memory)
        if self._channels:
            self._memory.channels.feed(context)
        if self._deltas:
            self._memory.deltas.feed(context)
        transfers = TransferSet(context)
        for work in self._works:
            yield from work.feed(view, context, transfers)

    def finish(self, view: BatchView) -> Iterator[Occurrences | Occurrence]:
        """Return the breaches that only the end shows."""
        for work in self._works:
            yield from work.finish(view)


class _Side:
    """A filter of a rule, with what it remembers of fields."""

    def __init__(self, clause: Clause, more: Iterable[FieldRef] = ()) -> None:
        self.clause = clause
        self.fields = tuple({ref.key: ref for ref in (*clause.fields, *more)}.values())
        self._lags = [LaggedField(node) for node in clause.lags]
        self._held: dict[object, HeldField] = {
            ref.key: HeldField(ref)
            for ref in self.fields
            if ref.origin == "table" and not set(ref.tables) <= set(clause.tables)
        }

    def feed(self, view: BatchView, context: BatchContext, transfers: TransferSet) -> tuple[HandSet, Array]:
        """Return the rows at hand, and of which the filter holds."""
        context.lagged = [lag.feed(context) for lag in self._lags]
        for held in self._held.values():
            held.feed(context, view)
        tables = self.clause.tables
        hand = rows_at_hand(view, tables)
        rows = HandSet(context, view, hand, tables, transfers, self._held, self.clause.lags)
        return rows, self.clause.condition.test(rows) if rows.size else np.zeros(0, bool)


class _Work:
    """One rule at work."""

    def __init__(self, own: OwnRule) -> None:
        self._own, self.rule = own, own.rule
        told = [part for part in own.text if not isinstance(part, str)]
        self._when = _Side(own.when, told)
        self._then = None if own.then is None else _Side(own.then)
        self._streaks = Streaks(own.lasts) if own.lasts else None
        mine = set(own.when.tables)
        same = own.then is not None and bool(mine & set(own.then.tables))
        self._demands = None if own.then is None else Demands(own.within, same=same)
        compared = () if own.then is None else own.then.fields
        self._told = [ref for ref in compared if ref.origin == "table" and mine & set(ref.tables) and not same]
        self._last = NO_TIME
        self.fields = (*self._when.fields, *compared)

    @property
    def decided(self) -> bool:
        """True once a demand was answered, or not."""
        return self._demands is not None and self._demands.decided

    def copy(self) -> _Work:
        found = copy(self)
        for name in ("_demands", "_streaks"):
            vars(found)[name] = deepcopy(vars(self)[name])
        return found

    def feed(
        self, view: BatchView, context: BatchContext, transfers: TransferSet
    ) -> Iterator[Occurrences | Occurrence]:
        rows, holds = self._when.feed(view, context, transfers)
        if self._streaks is not None and (not self._streaks.idle or holds.any()):
            found = self._streaks.feed(_streams(view, rows.hand).tolist(), _times(view, rows.hand), holds.tolist())
            lasting = np.zeros(len(holds), bool)
            lasting[found] = True
        else:
            lasting = holds
        if self._then is not None:
            answer = self._then.feed(view, context, transfers)
            yield from self._follow(view, rows, (holds, lasting), *answer)
        elif lasting.any():
            yield self._occurrences(view, rows, np.flatnonzero(lasting))

    def finish(self, view: BatchView) -> Iterator[Occurrence]:
        if self._demands is not None and self._last != NO_TIME:
            for demand, bus in self._demands.overdue(self._last, over=True):
                yield from self._breach(view, demand, bus)

    def _occurrences(self, view: BatchView, rows: HandSet, chosen: Array) -> Occurrences:
        found = view.among_transfers(self.rule, rows.hand.owner[chosen], _nothing, key=rows.hand.device[chosen])
        return replace(found, values=lambda k: self._said(rows, int(chosen[k])))

    def _follow(
        self, view: BatchView, rows: HandSet, holds: tuple[Array, Array], then: HandSet, answers: Array
    ) -> Iterator[Occurrence]:
        """Take the rows that open demands and those that answer them, in their order."""
        demands = self._demands
        assert demands is not None  # noqa: S101 - whoever calls this has one
        if len(view.frames) and int(view.frames.t[-1]) != NO_TIME:
            self._last = int(view.frames.t[-1])
        if not demands.idle or holds[1].any():
            told = _told(rows, self._told)
            events = _events(view, rows.hand, told, holds if self._told else (holds[1], holds[1]))
            events += _answers(view, then.hand, answers)
            events.sort(key=lambda one: (one[0], not one[1].answers))
            shown: dict[int, DemandWords] = {}

            def show(place: int) -> DemandWords:
                if place not in shown:
                    shown[place] = self._shown(view, rows, place)
                return shown[place]

            for demand, bus in demands.feed(event for _, event in events):
                yield from self._breach(view, replace(demand, shown=demand.shown or show(demand.place)), bus)
            demands.keep(show)
        for demand, bus in demands.overdue(self._last):
            yield from self._breach(view, demand, bus)

    def _shown(self, view: BatchView, rows: HandSet, place: int) -> DemandWords:
        row = int(rows.hand.owner[place])
        t = view.transfers
        frames = tuple(t.frames(row))
        node, name = int(t.src[row]) or None, view.type_name(int(t.code[row]))
        return DemandWords(node, name, frames, view.lines(frames), self._said(rows, place))

    def _breach(self, view: BatchView, demand: OpenDemand, bus: int) -> Iterator[Occurrence]:
        if view.paused(demand.t, demand.until):
            return
        shown = demand.shown
        if shown is None:
            return
        yield Occurrence(
            rule=self.rule, t=demand.t, bus=bus, node=shown.node, type=shown.type, frames=shown.frames,
            values=shown.values, drops=True, until=demand.until, lines=shown.lines,
        )  # fmt: skip

    # ---- words

    def _said(self, rows: HandSet, place: int) -> Values:
        parts = self._own.text
        if parts:
            text = "".join(part if isinstance(part, str) else value_words(rows, part, place) for part in parts)
        else:
            fields = [ref for ref in self._when.clause.fields if ref.origin in _SHOWN]
            told = [f"{ref.name} {value}" for ref in fields if (value := value_words(rows, ref, place)) != "-"]
            text = ", ".join(told[:MOST_SHOWN]) or self._own.page.title
            if self._own.then is not None:
                text += f": not followed by {' '.join(self._own.then.text.split())} within {self._own.within / 1e9:g} s"
        return {"said": text, "of": device_name(int(rows.hand.device[place]))}


def _nothing(_row: int) -> Values:
    return {}


def _streams(view: BatchView, hand: RowsAtHand) -> Array:
    """Return whose each row is: bus, node, device and type in one number."""
    t = view.transfers
    sender = t.bus[hand.owner].astype(np.int64) << 7 | (t.src[hand.owner] & 0x7F)
    return (sender << 11 | hand.device) << 32 | t.code[hand.owner]


def _times(view: BatchView, hand: RowsAtHand) -> list[int]:
    times: list[int] = view.transfers.t[hand.owner].tolist()
    return times


def _events(
    view: BatchView, hand: RowsAtHand, told: list[object], holds: tuple[Array, Array]
) -> list[tuple[int, Event]]:
    """Return the rows that open demands (where the second holds) or withdraw them (where the first does not)."""
    chosen = np.flatnonzero(holds[1] | ~holds[0] if told else holds[1])
    stream, t, buses = _streams(view, hand), view.transfers.t[hand.owner], view.transfers.bus[hand.owner]
    return [
        (
            int(hand.owner[k]),
            Event(
                int(t[k]), int(buses[k]), int(stream[k]), int(hand.device[k]), bool(holds[1][k]), not holds[0][k],
                False, told[k] if told else None, int(k),
            ),
        )
        for k in chosen.tolist()
    ]  # fmt: skip


def _answers(view: BatchView, hand: RowsAtHand, answers: Array) -> list[tuple[int, Event]]:
    stream, t, buses = _streams(view, hand), view.transfers.t[hand.owner], view.transfers.bus[hand.owner]
    return [
        (
            int(hand.owner[k]),
            Event(int(t[k]), int(buses[k]), int(stream[k]), int(hand.device[k]), False, False, True, None, -1),
        )
        for k in np.flatnonzero(answers).tolist()
    ]


def _told(rows: HandSet, fields: list[FieldRef]) -> list[object]:
    """Return for each row what it tells of fields; nothing if there are none."""
    if not fields:
        return []
    columns = []
    for ref in fields:
        values = rows.values(ref)
        good = np.flatnonzero(values.there())
        place = np.zeros(values.amount) if values.place is None else values.place
        numbers = _numbers(values.data)[good] * np.sqrt(2.0 + place[good])
        columns.append(np.bincount(values.rows()[good], numbers, minlength=rows.size).tolist())
    return list(zip(*columns, strict=True))


def _numbers(data: Array | CodedWords | ByteSpans) -> Array:
    if isinstance(data, CodedWords):
        return np.array([float(zlib.crc32(word.encode())) for word in data.words] or [0.0])[data.codes]
    if isinstance(data, ByteSpans):
        return np.array([float(zlib.crc32(one)) for one in data.each()])
    return floats(data)
