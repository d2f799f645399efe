"""The autopilot's clock on the time axis of a capture: found where its outputs are the commands on the bus."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.flight.autopilot.match import AROUND, GLANCE, RIVAL, Match, OutputMatch
from analyzer.flight.autopilot.search import CommandSearch
from analyzer.flight.autopilot.track import Signal, outputs
from analyzer.flight.thresholds import threshold
from dissectors.records import dataclass
from dissectors.times import MICROSECOND, MILLISECOND, SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.flight.autopilot.track import ClockRun
    from analyzer.sources.dataflash import AutopilotLog
    from dissectors.kit import Array

WINDOW = 60.0  # seconds of a log that are compared at once: clocks drift little in them
MOST_SEARCHED, MOST_WINDOWS = 8, 64
MOST_LOOKED_AT = 8  # more closely
_ALWAYS = 1 << 60
_FOLLOWED = 1e3  # places that are tried for a window, once one is known
_Window = tuple[float, float, float]  # first and last time in a log, and how much moves there
_LEAST_WINDOW = 2.0
_STEADY = 60.0  # seconds over which a drift can be told


@dataclass(frozen=True, slots=True)
class ClockPart:
    """A stretch of the capture in which the autopilot's clock is known: `offset` is its start on the capture's clock.

    All in ns, but `drift`, by which the capture's clock is faster, and log times, which are microseconds: `offset`
    holds at `at`, between `since` and `until` it was compared. `start`, `end`, `ran` and `holes` are
    those of the `ClockRun`.
    """

    start: int
    end: int
    ran: int
    offset: int
    error: int
    drift: float
    at: int
    since: int
    until: int
    holes: Sequence[tuple[int, int]] = ()

    def recorded(self, t: Array) -> Array:
        """Return times of the capture's clock as recorded ones: in a hole time stands still."""
        found: Array = t + self.ran
        for low, high in self.holes:
            found = found - (np.clip(t, low, high) - low)
        return found

    def time(self, micros: int) -> tuple[int, int]:
        """Return a time of the log on the capture's clock, and its error."""
        t = self.offset + micros * MICROSECOND + round(self.drift * (micros - self.at) * MICROSECOND)
        beyond = max(self.since - micros, micros - self.until, 0) * MICROSECOND
        return t, self.error + round(beyond * threshold("drift_ppm") / 1e6)


@dataclass(frozen=True, slots=True)
class Alignment:
    """How a log lies on a capture's time axis: its parts in order, none if that cannot be told; `text` says it.

    `by` is `outputs` or `given`; `moves` and `unexplained` are those of the best `Match`.
    """

    parts: Sequence[ClockPart]
    by: str
    text: str
    moves: float = 0
    unexplained: float = 0

    def plain(self, name: str) -> dict[str, Any]:
        """Return it as plain data; `name` is that of the log. Offsets are where its clock is 0."""
        parts = [
            {
                "t_ns": part.start, "t_end_ns": part.end, "offset_ns": part.time(0)[0], "error_ns": part.error,
                "drift_ppm": round(part.drift * 1e6, 3), "compared_us": [part.since, part.until],
            }
            for part in self.parts
        ]  # fmt: skip
        if self.by == "given":
            parts = [{**part, "compared_us": None} for part in parts]
        return {
            "name": name, "by": self.by, "text": self.text, "moves": round(self.moves, 1),
            "unexplained": round(self.unexplained, 6), "parts": parts,
        }  # fmt: skip

    def placed(self, micros: Array) -> tuple[Array, Array]:
        """Return times of the log by the capture's clock, and as recorded ones, each by the part it is nearest to."""
        away = [np.maximum(np.maximum(one.since - micros, micros - one.until), 0) for one in self.parts]
        nearest = np.argmin(away, axis=0)
        t, ran = np.zeros(len(micros), np.int64), np.zeros(len(micros), np.int64)
        for k, one in enumerate(self.parts):
            rows = nearest == k
            drift = np.round(one.drift * (micros[rows] - one.at) * MICROSECOND).astype(np.int64)
            t[rows] = one.offset + micros[rows] * MICROSECOND + drift
            ran[rows] = one.recorded(t[rows])
        return t, ran

    def part(self, micros: int) -> ClockPart:
        """Return the part that a time of the log is in, or nearest to."""
        return min(self.parts, key=lambda part: max(part.since - micros, micros - part.until, 0))


def align(log: AutopilotLog, pieces: Sequence[ClockRun], start: int) -> Alignment:
    """Find a log in the pieces of a capture, the first frame of which is at `start`."""
    mine = outputs(log)
    if not len(mine):
        return Alignment((), "outputs", "has no outputs (RCOU): nothing that the bus has, too")
    if not pieces:
        return Alignment((), "outputs", "no throttles are commanded on the bus: nothing to find it by")
    if not _moving(mine.values, threshold("output_moves_us")).any():
        return Alignment((), "outputs", "its outputs do not move: nothing to find it by")
    parts, best = [], None
    for piece in pieces:
        found = _matches(piece.commands, mine)
        if not found:
            continue
        parts.append(_part(piece, found))
        strongest = min(found, key=lambda match: match.chance)
        best = strongest if best is None else min(best, strongest, key=lambda match: match.chance)
    if best is None:
        return Alignment(
            (), "outputs", "its outputs are nowhere the commands on the bus: another flight, or too few moves"
        )
    began, error = parts[0].time(0)[0] - start, max(part.error for part in parts)
    steps = f"; the clock of the capture was set: {len(parts)} parts" if len(parts) > 1 else ""
    text = (
        f"its clock began {_from_start(began)}, to within {error / MILLISECOND:.1f} ms{steps}: {best.moves:.0f} moves "
        f"of its outputs are those of the commands on the bus, but for {100 * best.unexplained:.1f} %"
    )
    return Alignment(parts, "outputs", text, best.moves, best.unexplained)


def given(ns: int, start: int, end: int, holes: Sequence[tuple[int, int]] = ()) -> Alignment:
    """Return the alignment that somebody gives: the autopilot started `ns` behind the start of the capture."""
    part = ClockPart(start, end, 0, start + ns, 0, 0.0, 0, -_ALWAYS, _ALWAYS, holes)
    return Alignment((part,), "given", f"its clock began {_from_start(ns)}, as it is given")


def _matches(commands: Signal, mine: Signal) -> list[Match]:
    """Return where windows of a log are in a piece.

    A short capture may be anywhere in a long log, so all of it is searched first, then the windows that move the most.
    """
    pairs = list(_pairs(commands, mine))
    windows = sorted(_windows(mine, pairs), key=lambda window: -window[2])[:MOST_WINDOWS]
    if not windows:
        return []
    whole = min(low for low, *_ in windows), max(high for _, high, _ in windows), 0.0
    searches: dict[int, CommandSearch] = {}  # by the pair
    for window in (whole, *windows[:MOST_SEARCHED]):
        for k, (theirs, ours) in enumerate(pairs):
            bus, log = _of(commands, theirs), _of(mine, ours)
            search = searches.setdefault(k, CommandSearch(bus))
            match = _searched(search, bus, _within(log, window), len(pairs) * len(windows))
            if match is not None and match.proven:
                return _followed(bus, log, windows, match) or [match]
    return []


def _followed(bus: Signal, log: Signal, windows: Sequence[_Window], last: Match) -> list[Match]:
    """Return where windows are, of which one is known: each is near the one before, as far as clocks drift."""
    found: list[Match] = []
    waiting = list(windows)
    while waiting:
        window = min(waiting, key=lambda window: abs(window[0] - last.middle))
        waiting.remove(window)
        both = OutputMatch(bus, _within(log, window), _FOLLOWED)
        around = AROUND + threshold("drift_ppm") / 1e6 * abs(window[0] - last.middle)
        place, left = both.near(last.shift, around)
        match = both.at(place) if left < threshold("unexplained") else None
        if match is not None and match.proven:
            found.append(match)
            last = match
    return found


def _searched(search: CommandSearch, commands: Signal, mine: Signal, ways: int) -> Match | None:
    """Return the best place of a window, if there is any."""
    both = OutputMatch(commands, mine, search.places * ways * 16.0)
    looked = sorted((both.near(shift, step=GLANCE) for shift in search.candidates(mine)), key=lambda place: place[1])
    if not looked:
        return None
    places = [both.near(shift, 2 * GLANCE) for shift, _ in looked[:MOST_LOOKED_AT]] + looked[MOST_LOOKED_AT:]
    best = min(places, key=lambda place: place[1])
    rivals = min((left for shift, left in places if abs(shift - best[0]) > RIVAL), default=1.0)
    return both.at(best[0], rivals)


def _pairs(commands: Signal, mine: Signal) -> Iterator[tuple[Array, Array]]:
    """Yield rows of commands and of outputs that may be the same channels: both in the same order, without gaps."""
    theirs = np.flatnonzero(_moving(commands.values, threshold("command_moves_percent")))
    moving = _moving(mine.values, threshold("output_moves_us"))
    for first in range(-int(theirs.max(initial=0)), len(moving)):
        ours = theirs + first
        if len(ours) and ours[0] >= 0 and ours[-1] < len(moving) and moving[ours].all():
            yield theirs, ours


def _windows(mine: Signal, pairs: Sequence[tuple[Array, Array]]) -> Iterator[_Window]:
    """Yield stretches of a log in which outputs move: first and last time, and how much."""
    rows = sorted({int(row) for _, ours in pairs for row in ours})
    if not rows or len(mine) < 3:
        return
    moves = (np.diff(mine.values[rows], axis=1) ** 2).sum(axis=0)
    moving = np.flatnonzero(moves > 0)
    if not len(moving):
        return
    start, end = float(mine.time[moving[0]]), float(mine.time[moving[-1] + 1])
    count = max(1, round((end - start) / WINDOW))
    edges = np.linspace(start, end, count + 1)
    for low, high in pairwise(edges.tolist()):
        first, last = np.searchsorted(mine.time, [low, high])
        power = float(np.minimum(moves[first:last], 100 * np.median(moves[moving])).sum())
        if last - first > 3 and high - low >= _LEAST_WINDOW and power > 0:
            yield float(low), float(np.nextafter(high, np.inf)), power


def _part(piece: ClockRun, found: Sequence[Match]) -> ClockPart:
    """Return one clock for windows that were found in a piece, with a drift if they tell one."""
    middle, shift = np.array([match.middle for match in found]), np.array([match.shift for match in found])
    error = np.array([match.error for match in found])
    at = float(np.average(middle, weights=error**-2))
    drift, span = 0.0, float(np.ptp(middle))
    if span >= _STEADY:
        drift = float(np.polyfit(middle - at, shift, 1, w=1 / error)[0])
        drift = drift if abs(drift) * span > 2 * float(np.median(error)) else 0.0
    offset = float(np.average(shift - drift * (middle - at), weights=error**-2))
    off = float(np.abs(shift - offset - drift * (middle - at)).max())
    return ClockPart(
        piece.start, piece.end, piece.ran, piece.start + round(offset * SECOND),
        round((off + float(np.median(error))) * SECOND), drift, round(at * 1e6),
        round(min(match.since for match in found) * 1e6), round(max(match.until for match in found) * 1e6),
        piece.holes,
    )  # fmt: skip


def _moving(values: Array, least: float) -> Array:
    """Return the rows that have values, and different ones."""
    found = np.zeros(len(values), bool)
    for k, row in enumerate(values):
        known = row[~np.isnan(row)]
        found[k] = bool(len(known)) and float(np.ptp(known)) > least
    return found


def _of(signal: Signal, rows: Array) -> Signal:
    return Signal(signal.time, signal.values[rows])


def _within(signal: Signal, window: _Window) -> Signal:
    part = slice(*np.searchsorted(signal.time, window[:2]))
    return Signal(signal.time[part], signal.values[:, part])


def _from_start(ns: int) -> str:
    return f"{abs(ns) / SECOND:.4f} s {'before' if ns < 0 else 'behind'} the first frame"
