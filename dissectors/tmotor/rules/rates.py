"""How many frames a bus carries in a second, and how often throttle is commanded."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.conformance import MILLISECOND, NO_TIME, SECOND, Occurrence, Watcher
from dissectors.tmotor.rules.joins import Motion, Periods, commands, rows_by_bus
from dissectors.tmotor.rules.rows import breach

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.conformance import Found, View, Words

MOST_KEPT = 1 << 16  # frames of a bus that are remembered; a second with more counts as that many
_STRIDE = 256
_EXTENDED = 1
_TALKERS = 3
_FULL_RATE = 1_000_000
MOST_SENDERS = 128
_MIN_TO_SAY = 0.99


class Limit(NamedTuple):
    """How many frames a second may have while motors turn, or rest; `kbps` if it is scaled to a bit rate."""

    rule: str
    turning: bool
    frames: int
    kbps: int | None = None


@dataclass(slots=True)
class _Peak:
    """An overload under way: its first frame, the busiest second so far, the last frame over the limit."""

    t: int
    frame: int
    lines: tuple[str, ...]
    last: int
    frames: int = 0
    talkers: str = ""


@dataclass(slots=True, eq=False)
class _Past:
    """The frames of a bus that a coming second may hold, and since when motors turn or rest."""

    t: Words = field(default_factory=lambda: np.empty(0, np.int64))
    sender: Words = field(default_factory=lambda: np.empty(0, np.uint8))
    turning: bool = False
    since: int = NO_TIME
    peaks: dict[Limit, _Peak] = field(default_factory=dict)


class Load(Watcher):
    """Sliding seconds with too many frames; one occurrence for overloads less than 1 s apart."""

    rules = ("BUS-001", "BUS-002", "BUS-003")

    def __init__(self) -> None:
        self._motion = Motion()
        self._past: dict[int, _Past] = {}

    def look(self, view: View) -> Iterable[Found | Occurrence]:
        """Every second that ends in this batch."""
        changes = self._motion.add(view)
        frames, limits = view.frames, list(_limits(view))
        for bus, rows in rows_by_bus(frames.bus, frames.t):
            past = self._past.setdefault(bus, _Past(since=view.starts[bus]))
            fresh = frames.t if rows is None else frames.t[rows]
            old = len(past.t)
            t = np.concatenate((past.t, fresh))
            suspects = [limit for limit in limits if _may_exceed(t, limit.frames)]
            _, times, states = changes.get(bus, (0, np.empty(0, np.int64), np.empty(0, bool)))
            named = len(fresh) if suspects else min(len(fresh), MOST_KEPT)
            sender = np.concatenate((past.sender, _senders(view, rows, named)))
            ordered = np.maximum.accumulate(t) if suspects and bool((t[1:] < t[:-1]).any()) else t
            since, turning = np.concatenate(([past.since], times)), np.concatenate(([past.turning], states))
            for limit in suspects:
                at = _over(t, limit.frames, old)
                ends = _at(t, at)
                k = np.searchsorted(since[1:], ends, "right") if len(times) else np.zeros(1, np.int64)
                fits = (turning[k] == limit.turning) & (since[k] + SECOND <= ends)
                if not fits.all():
                    at, ends = at[fits], ends[fits]
                for part in np.split(at, np.flatnonzero(ends[1:] - ends[:-1] > SECOND) + 1):
                    if len(part):
                        number = frames.first + int(part[0] - old if rows is None else rows[part[0] - old])
                        yield from self._note(view, (bus, past), limit, (t, ordered, sender), (part, number))
            past.since, past.turning = int(since[-1]), bool(turning[-1])
            keep = min(int(np.searchsorted(t, t[-1] - SECOND)), len(t) - max(limit.frames for limit in limits) - 1)
            keep = max(keep, len(t) - MOST_KEPT, 0)
            past.t, past.sender = t[keep:].copy(), sender[keep - len(t) :].copy()
            yield from self._over_by(bus, past, int(t[-1]) - SECOND)

    def settle(self, _view: View) -> Iterable[Found | Occurrence]:
        """Overloads that last to the end."""
        for bus, past in self._past.items():
            yield from self._over_by(bus, past, None)

    def _note(
        self, view: View, where: tuple[int, _Past], limit: Limit, frames: tuple[Words, Words, Words],
        at: tuple[Words, int],
    ) -> Iterator[Occurrence]:  # fmt: skip
        (bus, past), (t, ordered, sender), (rows, first) = where, frames, at
        known = past.peaks.get(limit)
        if known is not None and t[rows[0]] - known.last > SECOND:
            yield _said(bus, limit, past.peaks.pop(limit))
        peak = past.peaks.setdefault(limit, _Peak(int(t[rows[0]]), first, view.lines((first,)), int(t[rows[-1]])))
        peak.last = int(t[rows[-1]])
        sample = _counts(ordered, rows[::_STRIDE])
        least = max(peak.frames, int(sample.max()) - 1)
        rows = rows[int(np.searchsorted(rows, least)) :]
        rows = rows[_at(ordered, rows) - _at(ordered, rows, least) < SECOND]  # those with more frames than that
        counts = _counts(ordered, rows)
        if int(counts.max(initial=0)) > peak.frames:
            best = int(np.argmax(counts))
            peak.frames = int(counts[best])
            stop = int(rows[best]) + 1
            peak.talkers = _talkers(sender[len(sender) - len(t) + stop - peak.frames : len(sender) - len(t) + stop])

    def _over_by(self, bus: int, past: _Past, t: int | None) -> Iterator[Occurrence]:
        for limit, peak in list(past.peaks.items()):
            if t is None or peak.last < t:
                yield _said(bus, limit, past.peaks.pop(limit))


def _limits(view: View) -> Iterator[Limit]:
    yield Limit("BUS-001", turning=True, frames=int(view.number("BUS-001", "limit_per_s")))
    yield Limit("BUS-002", turning=False, frames=int(view.number("BUS-002", "limit_per_s")))
    rate = view.bit_rate
    if rate is not None and 0 < rate < _FULL_RATE:
        for name, turning in (("operating_per_s", True), ("idle_per_s", False)):
            scaled = int(view.number("BUS-003", name) * rate / _FULL_RATE)
            yield Limit("BUS-003", turning, max(scaled, 1), round(rate / 1000))


def _may_exceed(t: Words, most: int) -> bool:
    """Whether a second could hold more frames: looks at every 256th frame only, where that says enough."""
    strides = (most + 1) // _STRIDE - 1
    if strides < 1:
        return len(t) > most
    coarse = t[::_STRIDE]
    return bool((coarse[strides:] - coarse[:-strides] < SECOND).any())


def _over(t: Words, most: int, old: int) -> Words:
    """Rows from `old` on at which a second ends that has more frames."""
    first = max(most, old)
    if len(t) <= first:
        return np.empty(0, np.int64)
    took = t[first:] - t[first - most : len(t) - most]
    return np.flatnonzero((took >= 0) & (took < SECOND)) + first


def _at(values: Words, rows: Words, before: int = 0) -> Words:
    """Values so many rows before ascending ones; no copy if those are without gaps."""
    if len(rows) and int(rows[-1]) - int(rows[0]) == len(rows) - 1:
        part: Words = values[int(rows[0]) - before : int(rows[-1]) + 1 - before]
    else:
        part = values[rows - before]
    return part


def _counts(ordered: Words, rows: Words) -> Words:
    """Frames of the seconds that end at rows."""
    starts = np.searchsorted(ordered, ordered[rows] - SECOND, "right")
    return np.minimum(rows - starts + 1, MOST_KEPT)


def _senders(view: View, rows: Words | None, last: int) -> Words:
    """Source nodes of a bus's last frames in this batch; 0 for 11-bit identifiers."""
    frames = view.frames
    which = slice(max(len(frames) - last, 0), None) if rows is None else rows[max(len(rows) - last, 0) :]
    return np.where(frames.flags[which] & _EXTENDED, frames.id[which] & 0x7F, 0).astype(np.uint8)


def _talkers(sender: Words) -> str:
    counts = np.bincount(sender)
    best = np.argsort(-counts, kind="stable")[:_TALKERS].tolist()
    names = ((f"node {node}" if node else "no node", int(counts[node])) for node in best)
    return ", ".join(f"{name} {count}" for name, count in names if count)


def _said(bus: int, limit: Limit, peak: _Peak) -> Occurrence:
    values: dict[str, int | str] = {"frames": peak.frames, "limit": limit.frames}
    values |= {"talkers": peak.talkers} if limit.kbps is None else {"kbps": limit.kbps}
    return Occurrence(limit.rule, peak.t, bus, None, "", (peak.frame,), values, lines=peak.lines)


class CommandRate(Watcher):
    """The rate of throttle commands of each node; the first 128 nodes."""

    rules = ("BUS-006",)

    def __init__(self) -> None:
        self._last: dict[tuple[int, int], int] = {}
        self._periods: dict[tuple[int, int], Periods] = {}
        self._first: dict[tuple[int, int], Occurrence] = {}

    def look(self, view: View) -> Iterable[Found | Occurrence]:
        """Collects periods."""
        if view.start == NO_TIME:
            return
        for bus, sent in commands(view).items():
            for node in np.flatnonzero(np.bincount(sent.src)).tolist():
                mine, who = np.flatnonzero(sent.src == node), (bus, node)
                t = sent.t[mine]
                if who not in self._first:
                    if len(self._first) >= MOST_SENDERS:
                        continue
                    self._periods[who] = Periods()
                    self._first[who] = breach(view, sent.table, int(sent.rows[mine[0]]), "BUS-006", {}, held=True)
                self._periods[who].add(np.diff(t, prepend=self._last.get(who, int(t[0]))))
                self._last[who] = int(t[-1])
        yield from ()

    def settle(self, view: View) -> Iterable[Found | Occurrence]:
        """Compares medians."""
        nominal = view.number("BUS-006", "period_ms") * MILLISECOND
        tolerance = view.number("BUS-006", "tolerance_pct") / 100
        for who, periods in self._periods.items():
            if periods.count + 1 < view.number("BUS-006", "min_transfers"):
                continue
            median = periods.below(0.5)
            if abs(median - nominal) > tolerance * nominal:
                values = {"hertz": SECOND / median, "slow_ms": periods.below(_MIN_TO_SAY) / MILLISECOND}
                yield replace(self._first[who], values=values)


WATCHERS: tuple[type[Watcher], ...] = (Load, CommandRate)
