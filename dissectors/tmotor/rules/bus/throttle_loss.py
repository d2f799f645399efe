"""Throttle commands that stop."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Pauses, Rule, breach
from dissectors.kit.order import steps
from dissectors.tmotor.rules.joined.joins import commands
from dissectors.tmotor.rules.joined.motion import Motion

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, Occurrence, Occurrences, View
    from dissectors.tmotor.rules.joined.joins import RawCommands

_RUNNING = 5  # so many commands without a pause are a stream that can stop
_MODES = (1, 8)  # operating modes: a word with one of these is no error counter


@dataclass(slots=True)
class _Stream:
    """The commands of a bus so far: how many without a pause, the last one, and the ESCs that miss it."""

    t: int
    count: int = 0
    place: Occurrence | None = None
    losing: set[int] = field(default_factory=set)


class ThrottlePauses(Rule):
    """Pauses of throttle commands."""

    rules = ("BUS-007",)

    def __init__(self) -> None:
        self._streams: dict[int, _Stream] = {}
        self._motion = Motion()
        self._pauses: Pauses | None = None

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Look at the times between commands."""
        if view.start == NO_TIME:
            return
        self._pauses = self._pauses or Pauses(round(view.number("CAP-002", "silence_s") * SECOND))
        self._pauses.feed(view)
        before = {bus: self._motion.turning(bus) for bus in range(len(view.buses))}
        changes = self._motion.feed(view)
        losing, now = _losing(view), commands(view)
        timeout = view.number("BUS-007", "timeout_ms") * MILLISECOND
        for bus in self._streams.keys() | now.keys():
            number, index = losing.get(bus, (np.empty(0, np.int64), np.empty(0, np.int64)))
            if bus not in now:
                self._streams[bus].losing.update(index.tolist())
                continue
            sent, stream = now[bus], self._streams.setdefault(bus, _Stream(int(now[bus].t[0])))
            last = -1
            for k in (steps(sent.t, stream.t) > timeout).nonzero()[0].tolist():
                if k:
                    stream.count += k - 1 - last
                if stream.count >= _RUNNING:
                    if k:
                        self._carry_on(view, stream, (sent, k - 1), (before[bus], changes.get(bus)), held=False)
                    inside = (number > (sent.number[k - 1] if k else -1)) & (number < sent.number[k])
                    stream.losing = {*(() if k else stream.losing), *index[inside].tolist()}
                    yield from self._stop(view, bus, stream, int(sent.t[k]))
                stream.count, last = 0, k - 1
            self._carry_on(view, stream, (sent, len(sent.t) - 1), (before[bus], changes.get(bus)))
            stream.count += len(sent.t) - 1 - last
            stream.losing = set(index[number > sent.number[-1]].tolist())

    def finish(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Yield commands that do not come back."""
        for bus, stream in self._streams.items():
            if self._pauses is not None:
                yield from self._stop(view, bus, stream, self._pauses.last.get(bus, stream.t))

    def _carry_on(
        self, view: View, stream: _Stream, what: tuple[RawCommands, int],
        motion: tuple[bool, tuple[Array, Array, Array] | None], *, held: bool = True,
    ) -> None:  # fmt: skip
        """Make a command the last one; it is `held` if it may be told with a later batch."""
        sent, k = what
        before, changes = motion
        at = -1 if changes is None else int(np.searchsorted(changes[0], sent.number[k], "right")) - 1
        turning = before if changes is None or at < 0 else bool(changes[2][at])
        rests = not turning and not sent.cmd[:, k][sent.cmd[:, k] >= -(1 << 13)].any()
        severity = "note" if rests else None
        stream.t = int(sent.t[k])
        stream.place = breach(view, sent.table, int(sent.rows[k]), "BUS-007", {}, held=held, severity=severity)

    def _stop(self, view: View, bus: int, stream: _Stream, stop: int) -> Iterator[Occurrence]:
        if stream.count < _RUNNING or stream.place is None or self._pauses is None:
            return
        silent = self._pauses.first(bus, stream.t, stop) - stream.t  # behind a gap all begins anew
        if silent > view.number("BUS-007", "timeout_ms") * MILLISECOND:
            indexes = ", ".join(map(str, sorted(stream.losing)))
            values = {"milliseconds": silent / MILLISECOND, "reported": f"index {indexes}" if indexes else "no ESC"}
            yield replace(stream.place, values=values, drops=True, until=stop)


def _losing(view: View) -> dict[int, tuple[Array, Array]]:
    """Return transfer numbers and indexes of reports with throttle loss by bus, in order."""
    table = view.table("ESCStatus")
    if table is None or not table["error_count.throttle_loss"].any():
        return {}
    mode, found = table["error_count.mode"], table["error_count.throttle_loss"] & table.trusted
    rows = np.flatnonzero(found & (mode >= _MODES[0]) & (mode <= _MODES[1]))
    bus, number, index = table.bus[rows], table["transfer"][rows].astype(np.int64), table["esc_index"][rows]
    return {place: (number[bus == place], index[bus == place]) for place in np.flatnonzero(np.bincount(bus)).tolist()}
