"""The rules of a vehicle file that look at frames, each frame once, whatever becomes of it."""

from __future__ import annotations

from copy import copy, deepcopy
from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.identifiers import NOBODY, who
from analyzer.filter.context import BatchContext
from analyzer.filter.history import columns_of
from analyzer.filter.memory import FilterMemory
from analyzer.filter.rowsets import ErrorSet, FrameSet
from analyzer.rules.events import EVERY_BUS, when
from analyzer.rules.vehicle.lasting import Streaks
from analyzer.rules.vehicle.own_words import MOST_SHOWN, value_words
from analyzer.tables import EXTENDED, VERDICTS
from dissectors.kit import Occurrences

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analyzer.filter.rowsets import RowSet
    from analyzer.rules.vehicle.own import OwnRule
    from analyzer.rules.view import BatchView
    from dissectors import Registry
    from dissectors.kit import Array, Values

_USED = VERDICTS.index("used")
_EXTENDED_KEY = 1 << 29  # beside an identifier: it has 29 bits
_ERROR_KEY = 1 << 30  # in place of the identifier of an error frame
_ERRORS = "error frames"


class FrameJudge:
    """Looks for frames that break the rules which name nothing but fields of frames."""

    def __init__(self, rules: Sequence[OwnRule], registry: Registry, labels: Mapping[int, str]) -> None:
        self._memory = FilterMemory(
            registry, numbering=None, zero=None, labels=labels, named=None, severities={}, frame_list=True,
            columns=columns_of(ref for one in rules for ref in one.told_fields),
        )  # fmt: skip
        self._works = [_FrameWork(one) for one in rules]
        self._deltas = any(ref.column == "delta" for one in rules for ref in one.told_fields)

    def copy(self) -> FrameJudge:
        """Return one whose rules go on by themselves."""
        found = copy(self)
        found._works = [work.copy() for work in self._works]  # noqa: SLF001 - its own
        return found

    def feed(self, view: BatchView) -> Iterator[Occurrences]:
        """Return the breaches of the next batch."""
        batch = view.batch
        if batch is None or not self._works:
            return
        self._memory.feed(batch)
        context = BatchContext(batch, self._memory)
        if self._deltas:
            self._memory.deltas.feed(context)
        frames = _frame_rows(view, context)
        errors = _error_rows(view, context) if any(work.errors for work in self._works) else None
        for work in self._works:
            yield from work.feed(frames)
            if work.errors and errors is not None:
                yield from work.feed(errors)


class _Rows:
    """Frames of a batch, or error frames, with what a finding says of each: `key` is bus and identifier."""

    def __init__(self, rows: RowSet, t: Array, bus: Array, number: Array, ids: Array, node: Array) -> None:
        self.rows, self.t, self.bus, self.number, self.ids, self.node = rows, t, bus, number, ids, node

    def key(self, at: Array) -> Array:
        """Return bus and identifier of rows as one number."""
        found: Array = self.bus[at].astype(np.int64) << 31 | self.ids[at]
        return found

    def keys(self) -> Array:
        """Return those of all."""
        return self.key(np.arange(len(self.ids)))


class _FrameWork:
    """One rule at work."""

    def __init__(self, own: OwnRule) -> None:
        self._own, self.errors = own, own.when.errors
        self._streaks = {kind: Streaks(own.lasts) for kind in (False, True)} if own.lasts else None

    def copy(self) -> _FrameWork:
        found = copy(self)
        found._streaks = deepcopy(self._streaks)  # noqa: SLF001 - its own
        return found

    def feed(self, rows: _Rows) -> Iterator[Occurrences]:
        """Return the breaches among rows."""
        if not rows.rows.size:
            return
        holds = self._own.when.condition.test(rows.rows)
        chosen = np.flatnonzero(holds)
        if self._streaks is not None:
            chosen = self._lasting(rows, holds, self._streaks[isinstance(rows.rows, ErrorSet)])
        if len(chosen):
            yield self._occurrences(rows, chosen)

    def _lasting(self, rows: _Rows, holds: Array, streaks: Streaks) -> Array:
        """Return the rows at which it has held for long enough, of each bus and identifier by itself."""
        if streaks.idle and not holds.any():
            return np.zeros(0, np.int64)
        keys = rows.keys()
        followed = np.union1d(keys[holds], np.array(streaks.keys, np.int64))
        at = np.flatnonzero(np.isin(keys, followed))
        found = streaks.feed(keys[at].tolist(), rows.t[at].tolist(), holds[at].tolist())
        return at[found]

    def _occurrences(self, rows: _Rows, chosen: Array) -> Occurrences:
        number = rows.number[chosen]
        return Occurrences(
            rule=self._own.rule, t=rows.t[chosen], bus=rows.bus[chosen], node=rows.node[chosen],
            type=np.full(len(chosen), NOBODY), frame=number, key=rows.ids[chosen],
            values=lambda k: self._said(rows, int(chosen[k])),
            frames=lambda k: (int(number[k]),) if number[k] != NOBODY else (),
        )  # fmt: skip

    def _said(self, rows: _Rows, place: int) -> Values:
        parts = self._own.text
        if parts:
            text = "".join(one if isinstance(one, str) else value_words(rows.rows, one, place) for one in parts)
        else:
            fields = self._own.when.fields
            told = [f"{one.name} {value}" for one in fields if (value := value_words(rows.rows, one, place)) != "-"]
            text = ", ".join(told[:MOST_SHOWN]) or self._own.page.title
        return {"said": text, "of": _name(int(rows.ids[place]))}


def _name(key: int) -> str:
    """Return what people call an identifier: three digits for 11 bits, eight for 29."""
    if key == _ERROR_KEY:
        return _ERRORS
    return f"id {key & ~_EXTENDED_KEY:08X}" if key & _EXTENDED_KEY else f"id {key:03X}"


def _frame_rows(view: BatchView, context: BatchContext) -> _Rows:
    """Return all frames of a batch; verdicts, which come later, have no part in it."""
    f = view.frames
    number = np.arange(len(f)) + f.first
    verdicts = np.full(len(f), _USED)
    extended = np.where(f.flags & EXTENDED != 0, _EXTENDED_KEY, 0)
    node, _ = who(f.id, f.flags, verdicts)
    ids = f.id.astype(np.int64) | extended
    return _Rows(FrameSet(context, number, verdicts), f.t, f.bus, number, ids, node)


def _error_rows(view: BatchView, context: BatchContext) -> _Rows:
    at, events = context.error_rows, view.events
    none, size = np.full(len(at), NOBODY), len(at)
    t = np.fromiter((when(view, row) for row in at.tolist()), np.int64, size)
    buses = np.where(events.has("bus"), events.bus.astype(np.int64), EVERY_BUS)[at] if size else none
    return _Rows(ErrorSet(context, at), t, buses, none, np.full(size, _ERROR_KEY), none)
