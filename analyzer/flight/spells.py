"""Spells, which are so for a while: runs of rows of one key for which something holds, across batches."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dissectors.kit.order import changes, steps
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator

    from analyzer.flight.clock import RowPlaces, Spot
    from dissectors.kit import Array

MOST_KEYS = 1 << 14


@dataclass(slots=True)
class Spell:
    """A run of rows: `before` is the last row that was otherwise, `first` and `last` are those of the run.

    `after` is the first row behind it, None if none came; `silent` says that nothing came for too long before that.
    `memory` is for whoever watches it.
    """

    key: Any
    before: Spot | None
    first: Spot
    last: Spot
    after: Spot | None = None
    silent: bool = False
    memory: Any = None


class SpellPart(NamedTuple):
    """The rows from `start` to before `stop` of what was fed, which belong to a spell; `over` if it ends with them."""

    spell: Spell
    start: int
    stop: int
    over: bool


@dataclass(slots=True)
class _State:
    last: Spot | None = None
    spell: Spell | None = None


class Spells:
    """Follows keys, `MOST_KEYS` of them at most.

    Args:
        patience: recorded time without a row that ends a spell, 0 for none.
        least: recorded time from its first to its last row; spells of less that are over by the end of the rows in
            which they begin are left out.
    """

    def __init__(self, patience: int = 0, least: int = 0) -> None:
        self._patience, self._least = patience, least
        self._states: dict[Hashable, _State] = {}

    def feed(
        self, key: Hashable, on: Array, at: RowPlaces, torn: Array | None = None, last: Spot | None = None
    ) -> Iterator[SpellPart]:
        """Take the next rows of a key, those `on` for which it holds; yield the parts of spells among them.

        A spell ends before a row that is `torn` from those before it. `last` is the row before these, where not all
        rows were fed; rows for which nothing holds need not be fed while no spell of the key is `open`.
        """
        if not len(on):
            return
        state = self._states.get(key)
        if state is None:
            if len(self._states) >= MOST_KEYS:
                return
            state = self._states[key] = _State()
        state.last = last or state.last
        if state.spell is None and not on.any():
            state.last = at.at(-1)
            return
        if torn is None and state.spell is not None and on.all() and not self._late(state, at):
            state.spell.last = state.last = at.at(-1)
            yield SpellPart(state.spell, 0, len(on), over=False)
            return
        yield from self._parts(key, state, on, at, torn)

    def _parts(
        self, key: Hashable, state: _State, on: Array, at: RowPlaces, torn: Array | None
    ) -> Iterator[SpellPart]:  # fmt: skip
        late = np.zeros(len(on), bool) if torn is None else torn
        if self._patience:
            since = at.ran[0] if state.last is None else state.last.ran
            late = late | (steps(at.ran, since) > self._patience)
        borders = late.copy()
        borders[changes(on, state.spell is not None)] = True
        rows, start = np.flatnonzero(borders), 0
        begins = on[rows]
        if self._least and len(rows):
            rows, begins = self._without_short(state, rows, on, at)
        columns = rows.tolist(), begins.tolist(), late[rows].tolist(), at.spots(rows - 1), at.spots(rows)
        for k, holds, anew, before, here in zip(*columns, strict=True):
            last = before if k else state.last
            spell = state.spell
            if spell is not None and last is not None and (anew or not holds):
                spell.last, spell.after, spell.silent = last, here, anew
                state.spell = None
                yield SpellPart(spell, start, k, over=True)
            if holds:
                start = k
                state.spell = Spell(key, None if anew else last, here, here)
        state.last = at.at(-1)
        if state.spell is not None:
            state.spell.last = state.last
            yield SpellPart(state.spell, start, len(on), over=False)

    def _without_short(self, state: _State, rows: Array, on: Array, at: RowPlaces) -> tuple[Array, Array]:
        """Return the borders of spells, and which of them begin one, without those that are too short."""
        holds, ran = on[rows], at.ran
        holds[:-1] &= ran[rows[1:] - 1] - ran[rows[:-1]] >= self._least
        kept = holds.copy()
        kept[1:] |= holds[:-1]  # which end one
        kept[0] |= state.spell is not None
        return rows[kept], holds[kept]

    def _late(self, state: _State, at: RowPlaces) -> bool:
        """Return whether any of some rows came too late to go on with what was."""
        if not self._patience:
            return False
        return at.pace[1] > self._patience or (
            state.last is not None and at.at(0).ran - state.last.ran > self._patience
        )

    def open(self, key: Hashable) -> bool:
        """Return whether a spell of a key is not over."""
        state = self._states.get(key)
        return state is not None and state.spell is not None

    def finish(self) -> Iterator[Spell]:
        """Yield the spells that are not over, in the order in which their keys came."""
        yield from (state.spell for state in self._states.values() if state.spell is not None)
