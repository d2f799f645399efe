"""Spells, which are so for a while: runs of rows of one key for which something holds, across batches."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dissectors.kit.order import changes
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
    """

    def __init__(self, patience: int = 0) -> None:
        self._patience = patience
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
        late = np.zeros(len(on), bool) if torn is None else torn
        if self._patience:
            before = at.ran[0] if state.last is None else state.last.ran
            late = late | (np.diff(at.ran, prepend=before) > self._patience)
        start = 0
        for k in np.union1d(changes(on, state.spell is not None), np.flatnonzero(late)).tolist():
            last = at.at(k - 1) if k else state.last
            spell = state.spell
            if spell is not None and last is not None and (late[k] or not on[k]):
                spell.last, spell.after, spell.silent = last, at.at(k), bool(late[k])
                state.spell = None
                yield SpellPart(spell, start, k, over=True)
            if on[k]:
                start, here = k, at.at(k)
                state.spell = Spell(key, None if late[k] else last, here, here)
        state.last = at.at(-1)
        if state.spell is not None:
            state.spell.last = state.last
            yield SpellPart(state.spell, start, len(on), over=False)

    def open(self, key: Hashable) -> bool:
        """Return whether a spell of a key is not over."""
        state = self._states.get(key)
        return state is not None and state.spell is not None

    def finish(self) -> Iterator[Spell]:
        """Yield the spells that are not over, in the order in which their keys came."""
        yield from (state.spell for state in self._states.values() if state.spell is not None)
