"""Traffic over time: frames and bits by interface, transfers by node, in steps that grow with the capture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors.kit import NO_TIME, SECOND

if TYPE_CHECKING:
    from dissectors.kit import Array, View


MOST_STEPS = 2048  # as many, and two become one
MOST_KEYS = 4096
_MOST_AT_ONCE = 1 << 14  # steps of keys that are added up as a whole
_NODES = 128
_KEYS = 256 * _NODES


class Course:
    """Adds up batches. Steps begin at the first frame with a time; what lies before it counts in the first step."""

    def __init__(self) -> None:
        self.start: int | None = None
        self.step = SECOND
        self._last = 0
        self._frames = _Series()  # by bus
        self._bits = _Series()
        self._transfers = _Series(np.int32)  # by bus and node: there are up to 4096

    def feed(self, view: View) -> None:
        """Add the next batch."""
        if self.start is None:
            known = view.frames.t != NO_TIME
            if not known.any():
                return
            self.start = int(view.frames.t[int(np.argmax(known))])
        seconds = view.seconds
        if len(seconds.bus):
            at = self._steps(seconds.start)
            self._frames.add(seconds.bus, at, seconds.frames)
            self._bits.add(seconds.bus, at, seconds.bits)
        transfers = view.transfers
        known = transfers.t != NO_TIME
        t, key = transfers.t, transfers.bus.astype(np.int64) * _NODES + (transfers.src & 0x7F)
        if not known.all():
            t, key = t[known], key[known]
        if len(t):
            self._transfers.add(key, self._steps(t), 1)

    def frames(self, bus: int) -> tuple[int, ...]:
        """Return frames of an interface in each step."""
        return self._series(self._frames, bus)

    def bits(self, bus: int) -> tuple[int, ...]:
        """Return bits of an interface on the wire in each step."""
        return self._series(self._bits, bus)

    def transfers(self, bus: int, node: int) -> tuple[int, ...]:
        """Return transfers of a node in each step."""
        return self._series(self._transfers, bus * _NODES + node)

    def _steps(self, t: Array) -> Array:
        """Return the steps of times; steps are widened until all are inside."""
        start, latest = self.start or 0, int(t.max())
        while (latest - start) // self.step >= MOST_STEPS:
            self._double()
        self._last = max(self._last, (latest - start) // self.step)
        found: Array = np.maximum((t - start) // self.step, 0)
        return found

    def _series(self, series: _Series, key: int) -> tuple[int, ...]:
        return series.of(key)[: self._last + 1]

    def _double(self) -> None:
        self.step *= 2
        self._last //= 2
        for series in (self._frames, self._bits, self._transfers):
            series.halve()


class _Series:
    """A number for each key and step; further keys than `MOST_KEYS` are left out."""

    def __init__(self, number: type[np.signedinteger[Any]] = np.int64) -> None:
        self._known = 0
        self._row_of = np.full(_KEYS, -1, np.int32)
        self._counts = np.zeros((0, MOST_STEPS), number)

    def add(self, keys: Array, at: Array, much: Array | int) -> None:
        """Add so much to steps of keys."""
        rows = self._row_of[keys]
        if (rows < 0).any():
            self._note(np.unique(keys[rows < 0])[: MOST_KEYS - self._known])
            rows = self._row_of[keys]
            known = rows >= 0
            rows, at, much = rows[known], at[known], much if isinstance(much, int) else much[known]
        first, count = (int(at.min()), int(at.max()) - int(at.min()) + 1) if len(at) else (0, 0)
        if isinstance(much, int) and 0 < self._known * count <= _MOST_AT_ONCE:
            some = np.bincount(rows * count + (at - first), minlength=self._known * count)
            self._counts[: self._known, first : first + count] += much * some.reshape(self._known, count)
        else:
            np.add.at(self._counts.reshape(-1), rows * MOST_STEPS + at, much)

    def of(self, key: int) -> tuple[int, ...]:
        """Return the steps of a key, none of one that nobody has added to."""
        row = self._row_of[key]
        return tuple(self._counts[row].tolist()) if row >= 0 else ()

    def halve(self) -> None:
        """Let every two steps be one."""
        halved = self._counts.reshape(len(self._counts), MOST_STEPS // 2, 2).sum(axis=2)
        self._counts[:] = np.pad(halved, ((0, 0), (0, MOST_STEPS - halved.shape[1])))

    def _note(self, keys: Array) -> None:
        self._row_of[keys] = np.arange(self._known, self._known + len(keys))
        self._known += len(keys)
        room = len(self._counts)
        if self._known > room:
            more = min(max(self._known - room, room), MOST_KEYS - room)
            self._counts = np.concatenate((self._counts, np.zeros((more, MOST_STEPS), self._counts.dtype)))
