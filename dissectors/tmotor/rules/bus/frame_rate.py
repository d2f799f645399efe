"""How many frames a bus carries in a second."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule, set_back, times_by_bus
from dissectors.tmotor.rules.joined.motion import Motion

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, Occurrences, View

MOST_KEPT = 1 << 16  # frames of a bus that are remembered; a second with more counts as that many
MOST_HELD = 1024  # overloads of a bus of which nobody knows whether motors turn
_STRIDE = 256
_EXTENDED = 1
_TALKERS = 3
_FULL_RATE = 1_000_000
_NO_CHANGES = np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0, bool)


class FrameLimit(NamedTuple):
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

    t: Array = field(default_factory=lambda: np.empty(0, np.int64))
    sender: Array = field(default_factory=lambda: np.empty(0, np.uint8))
    turning: bool = False
    since: int = NO_TIME
    peaks: dict[FrameLimit, _Peak] = field(default_factory=dict)


class FrameRate(Rule):
    """Sliding seconds with too many frames; one occurrence for overloads less than 1 s apart.

    What is found on a bus is held back until a throttle or an ESC of the document is heard there: of others nobody
    knows here whether their motors rest.
    """

    rules = ("BUS-001", "BUS-002", "BUS-003")

    def __init__(self) -> None:
        self._motion = Motion()
        self._past: dict[int, _Past] = {}
        self._held: dict[int, list[Occurrence]] = {}

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Judge every second that ends in this batch."""
        changes = self._motion.feed(view)
        for bus in [bus for bus in self._held if self._motion.known(bus)]:
            yield from self._held.pop(bus)
        frames = view.frames
        for one in times_by_bus(frames):
            bus, rows, fresh = one.bus, one.rows, one.t
            past = self._past.setdefault(bus, _Past(since=view.starts[bus]))
            motion = changes.get(bus, _NO_CHANGES)
            back = set_back(np.append(past.t[-1:], fresh if one.back else fresh[:1])) - len(past.t[-1:])
            if not len(back):
                yield from self._judge(view, (bus, past), rows, fresh, motion[1:])
                continue
            yield from self._judge_parts(view, (bus, past), rows, back, motion)

    def _judge_parts(
        self, view: View, where: tuple[int, _Past], rows: Array | None, back: Array,
        motion: tuple[Array, Array, Array],
    ) -> Iterator[Occurrence]:  # fmt: skip
        """Judge the seconds that end in rows of one bus, whose clock was set back at some places among these."""
        (bus, past), frames = where, view.frames
        rows = np.arange(len(frames)) if rows is None else rows
        begins = np.append(0, back) if back[0] else back
        lengths = np.diff(begins, append=len(rows))
        ends = _ends(view, motion[0])
        low, high = np.searchsorted(ends, rows[begins]), np.searchsorted(ends, rows[begins + lengths - 1] + 1)
        # Too few are not too many; unless they are the first or last ones, they are forgotten with the next step.
        looked = (lengths > min(limit.frames for limit in _limits(view))) | (high > low)
        looked[0] |= back[0] > 0
        looked[-1] = True
        first = frames.t[rows[begins]]
        done = 0
        for k in np.flatnonzero(looked).tolist():
            if k or not back[0]:
                yield from self._begin_anew(bus, past, int(first[done : k + 1].min()))
            done = k + 1
            part = rows[begins[k] : begins[k] + lengths[k]]
            mine = slice(low[k], high[k])
            yield from self._judge(view, where, part, frames.t[part], (motion[1][mine], motion[2][mine]))

    def _judge(
        self, view: View, where: tuple[int, _Past], rows: Array | None, fresh: Array, motion: tuple[Array, Array]
    ) -> Iterator[Occurrence]:
        """Judge the seconds that end in rows of one bus, none of which the clock was set back for."""
        (bus, past), (times, states), limits = where, motion, list(_limits(view))
        old = len(past.t)
        t = np.concatenate((past.t, fresh))
        suspects = [limit for limit in limits if _may_exceed(t, limit.frames)]
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
                    number = view.frames.first + int(part[0] - old if rows is None else rows[part[0] - old])
                    yield from self._note(view, (bus, past), limit, (t, ordered, sender), (part, number))
        past.since, past.turning = int(since[-1]), bool(turning[-1])
        keep = min(int(np.searchsorted(t, t[-1] - SECOND)), len(t) - max(limit.frames for limit in limits) - 1)
        keep = max(keep, len(t) - MOST_KEPT, 0)
        past.t, past.sender = t[keep:].copy(), sender[keep - len(t) :].copy()
        yield from self._over_by(bus, past, int(t[-1]) - SECOND)

    def _begin_anew(self, bus: int, past: _Past, t: int) -> Iterator[Occurrence]:
        """Forget the times before the clock was set back; no second lasts from before it to behind it."""
        yield from self._over_by(bus, past, None)
        past.t, past.sender = past.t[:0], past.sender[:0]
        past.since = min(past.since, t)

    def finish(self, _view: View) -> Iterable[Occurrences | Occurrence]:
        """Yield overloads that last to the end."""
        for bus, past in self._past.items():
            yield from self._over_by(bus, past, None)

    def _note(
        self, view: View, where: tuple[int, _Past], limit: FrameLimit, frames: tuple[Array, Array, Array],
        at: tuple[Array, int],
    ) -> Iterator[Occurrence]:  # fmt: skip
        (bus, past), (t, ordered, sender), (rows, first) = where, frames, at
        known = past.peaks.get(limit)
        if known is not None and t[rows[0]] - known.last > SECOND:
            yield from self._known(bus, _overload(bus, limit, past.peaks.pop(limit)))
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
                yield from self._known(bus, _overload(bus, limit, past.peaks.pop(limit)))

    def _known(self, bus: int, found: Occurrence) -> Iterator[Occurrence]:
        if self._motion.known(bus):
            yield found
        elif len(held := self._held.setdefault(bus, [])) < MOST_HELD:
            held.append(found)


def _ends(view: View, numbers: Array) -> Array:
    """Return rows of the last frames of transfers of this batch."""
    last = (view.transfers.frames(number - view.transfers.first)[-1] for number in numbers.tolist())
    return np.fromiter(last, np.int64, len(numbers)) - view.frames.first


def _limits(view: View) -> Iterator[FrameLimit]:
    yield FrameLimit("BUS-001", turning=True, frames=int(view.number("BUS-001", "limit_per_s")))
    yield FrameLimit("BUS-002", turning=False, frames=int(view.number("BUS-002", "limit_per_s")))
    rate = view.bit_rate
    if rate is not None and 0 < rate < _FULL_RATE:
        for name, turning in (("operating_per_s", True), ("idle_per_s", False)):
            scaled = int(view.number("BUS-003", name) * rate / _FULL_RATE)
            yield FrameLimit("BUS-003", turning, max(scaled, 1), round(rate / 1000))


def _may_exceed(t: Array, most: int) -> bool:
    """Return whether a second could hold more frames: look at every 256th frame only, where that says enough."""
    strides = (most + 1) // _STRIDE - 1
    if strides < 1:
        return len(t) > most
    coarse = t[::_STRIDE]
    return bool((coarse[strides:] - coarse[:-strides] < SECOND).any())


def _over(t: Array, most: int, old: int) -> Array:
    """Return rows from `old` on at which a second ends that has more frames."""
    first = max(most, old)
    if len(t) <= first:
        return np.empty(0, np.int64)
    took = t[first:] - t[first - most : len(t) - most]
    return np.flatnonzero((took >= 0) & (took < SECOND)) + first


def _at(values: Array, rows: Array, before: int = 0) -> Array:
    """Return values so many rows before ascending ones; no copy if those are without gaps."""
    if len(rows) and int(rows[-1]) - int(rows[0]) == len(rows) - 1:
        part: Array = values[int(rows[0]) - before : int(rows[-1]) + 1 - before]
    else:
        part = values[rows - before]
    return part


def _counts(ordered: Array, rows: Array) -> Array:
    """Return frames of the seconds that end at rows."""
    starts = np.searchsorted(ordered, ordered[rows] - SECOND, "right")
    return np.minimum(rows - starts + 1, MOST_KEPT)


def _senders(view: View, rows: Array | None, last: int) -> Array:
    """Return source nodes of a bus's last frames in this batch; 0 for 11-bit identifiers."""
    frames = view.frames
    which = slice(max(len(frames) - last, 0), None) if rows is None else rows[max(len(rows) - last, 0) :]
    return np.where(frames.flags[which] & _EXTENDED, frames.id[which] & 0x7F, 0).astype(np.uint8)


def _talkers(sender: Array) -> str:
    counts = np.bincount(sender)
    best = np.argsort(-counts, kind="stable")[:_TALKERS].tolist()
    names = ((f"node {node}" if node else "no node", int(counts[node])) for node in best)
    return ", ".join(f"{name} {count}" for name, count in names if count)


def _overload(bus: int, limit: FrameLimit, peak: _Peak) -> Occurrence:
    values: dict[str, int | str] = {"frames": peak.frames, "limit": limit.frames}
    values |= {"talkers": peak.talkers} if limit.kbps is None else {"kbps": limit.kbps}
    return Occurrence(limit.rule, peak.t, bus, None, "", (peak.frame,), values, lines=peak.lines)
