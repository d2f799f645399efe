"""`load`: how busy each bus is, second by second, and who makes it so."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.identifiers import NOBODY, who
from analyzer.rules.catalogue import load as rule_pages
from analyzer.stats.chosen import alike
from analyzer.stats.distribution import Distribution
from analyzer.stats.statistic import Statistic, percent
from analyzer.stats.table import StatColumn, StatTable
from analyzer.stats.traffic import type_of
from analyzer.tables import distinct
from dissectors.kit import set_back
from dissectors.records import dataclass, field
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer.stats.chosen import ChosenBatch, ChosenFrames
    from analyzer.stats.order import StatOrder
    from analyzer.stats.statistic import StatEnd
    from dissectors import Registry
    from dissectors.kit import Array

MOST_SECONDS = 200_000  # that are told one by one, of each bus
_SHOWN = 20  # seconds, the worst ones, if there are more
_CAUSES = 12  # senders in the worst second of a bus that are shown
SECONDS = (
    StatColumn("bus", "Bus", "text"),
    StatColumn("start_ns", "Second", "time"),
    StatColumn("frames", "Frames"),
    StatColumn("load_pct", "Load %", "number", 1, bar=True),
    StatColumn("most", "Most of it", "text"),
    StatColumn("most_pct", "%", "number", 0),
)
BUSES = (
    StatColumn("bus", "Bus", "text"),
    StatColumn("seconds", "Seconds"),
    StatColumn("mean_pct", "Mean %", "number", 1),
    StatColumn("p95_pct", "p95 %", "number", 1),
    StatColumn("worst_pct", "Worst %", "number", 1),
    StatColumn("worst_frames", "Frames/s"),
    StatColumn("worst_ns", "At", "time"),
)
CAUSES = (
    StatColumn("bus", "Bus", "text"),
    StatColumn("node", "Node", "text"),
    StatColumn("type", "Type", "text"),
    StatColumn("frames", "Frames"),
    StatColumn("load_pct", "Load %", "number", 1, bar=True),
    StatColumn("share_pct", "% of it", "number", 1),
)
_RATE = "{frames} frames in 1 s"  # what a rule says that has a limit for frames that came
_LATE = 64  # seconds that stay open for what is found out later
_OTHER = 0  # code of what is not DroneCAN

Counts = dict[int, tuple[int, int]]  # frames and bits by sender and type


@dataclass(slots=True)
class _Second:
    """A second that is under way, counted from the first frame of the capture."""

    start: int
    frames: int = 0
    bits: int = 0
    by: Counts = field(default_factory=dict)

    def add(self, code: int, frames: int, bits: int, sign: int) -> None:
        had = self.by.get(code, (0, 0))
        self.by[code] = had[0] + sign * frames, had[1] + sign * bits
        self.frames += sign * frames
        self.bits += sign * bits
        if not self.by[code][0]:
            del self.by[code]


@dataclass(slots=True)
class _BusLoad:
    """The seconds of one bus."""

    open: dict[int, _Second] = field(default_factory=dict)
    last: int | None = None
    seconds: list[tuple[int, int, int, int, int]] = field(default_factory=list)  # start, frames, bits, most, its bits
    worst: _Second | None = None
    bits: Distribution = field(default_factory=Distribution)
    passed: dict[str, int] = field(default_factory=dict)


class LoadTable(Statistic):
    """The seconds from the first frame on; where a clock is set back they begin anew."""

    def __init__(self, order: StatOrder) -> None:
        self._bit_rate = order.bit_rate
        self._origin: int | None = None
        self._buses: dict[int, _BusLoad] = {}
        self._limits = list(_limits(order.registry, order.bit_rate))

    def feed(self, batch: ChosenBatch) -> None:
        """Add the next batch. Frames of a filter come when their transfers end, and verdicts when they are known."""
        t, timed = batch.frames.t, batch.frames.timed
        if self._origin is None and timed.any():
            self._origin = int(t[np.argmax(timed)])
        if self._origin is None:
            return
        for number, (rows, sign) in enumerate(batch.changes):
            known = rows if rows.timed.all() else rows.take(np.flatnonzero(rows.timed))
            for bus in distinct(known.bus):
                here = known.bus == bus
                mine = known if here.all() else known.take(np.flatnonzero(here))
                one = self._buses.setdefault(bus, _BusLoad())
                if batch.rows is None and not number:
                    self._add_laps(one, mine)
                else:
                    self._add(one, mine, sign)

    def finish(self, end: StatEnd) -> Sequence[StatTable]:
        """Return the buses, the worst second of each with who caused it, and all seconds."""
        if not end.timed:
            return (StatTable("load", "load of each bus", BUSES, (), ["no times that can be compared: no load"]),)
        buses, seconds, notes, further = [], [], [], []
        causes: list[tuple[object, ...]] = []
        told: list[int] = []
        for bus, one in sorted(self._buses.items()):
            self._close(one, one.open)
            name, worst = end.buses[bus], one.worst
            if worst is None:
                continue
            quantiles = one.bits.mean or 0.0, one.bits.quantile(0.95) or 0.0, worst.bits
            pcts = [percent(bits, self._bit_rate) for bits in quantiles]
            buses.append((name, one.bits.count, *pcts, worst.frames, worst.start))
            ranked = sorted(worst.by.items(), key=lambda item: (-item[1][1], item[0]))
            told += range(len(causes), len(causes) + min(len(ranked), _CAUSES))
            if rest := ranked[_CAUSES:]:
                share = percent(sum(bits for _, (_, bits) in rest), worst.bits)
                further.append(f"{name}: and {len(rest)} more, {share:.1f} % of it together; -T json has all")
            for code, (frames, bits) in ranked:
                shares = percent(bits, self._bit_rate), percent(bits, worst.bits)
                causes.append((name, *_sender(end.registry, code), frames, *shares))
            for start, frames, bits, most, its in one.seconds:
                share = percent(its, bits)
                what = _sender(end.registry, most << 8)[1]
                seconds.append((name, start, frames, percent(bits, self._bit_rate), what, share))
            for text, count in one.passed.items():
                notes.append(f"{name}: {count} s {text}")
            if one.bits.count > len(one.seconds):
                notes.append(f"{name}: the seconds after the first {MOST_SECONDS} are told together only")
        seconds.sort(key=lambda row: row[1])
        worst_first = sorted(range(len(seconds)), key=lambda k: -seconds[k][3])
        shown = sorted(worst_first[:_SHOWN]) if len(seconds) > _SHOWN else None
        rate = f"{self._bit_rate / 1000:g} kbit/s"
        about = f"load of each bus in whole seconds, stuffing bits and gaps between frames included, at {rate}"
        notes = notes or ["no second is above a limit of check"]
        more = [f"the {_SHOWN} worst of {len(seconds)} seconds; -T csv has all"] if shown is not None else []
        return (
            StatTable("load", about, BUSES, buses, notes, main=False),
            StatTable("load_worst", "who causes the worst second", CAUSES, causes, further, told, main=False),
            StatTable("load_seconds", "second by second", SECONDS, seconds, more, shown),
        )

    def _add_laps(self, bus: _BusLoad, rows: ChosenFrames) -> None:
        """Add frames in the order of the capture; where the clock was set back all seconds begin anew."""
        back = set_back(np.append(int(rows.t[0]) if bus.last is None else bus.last, rows.t)) - 1
        bus.last = int(rows.t[-1])
        for start, stop in pairwise([0, *back.tolist(), len(rows.t)]):
            if start in back:
                self._close(bus, bus.open)
            if stop > start:
                self._add(bus, rows.take(slice(start, stop)), 1)

    def _add(self, bus: _BusLoad, rows: ChosenFrames, sign: int) -> None:
        index = (rows.t - (self._origin or 0)) // SECOND
        first = int(index.min()) if len(index) else 0
        order, begins = alike(rows, index - first)
        places = order[begins]
        frames = np.diff(begins, append=len(order)).tolist()
        bits = np.add.reduceat(rows.bits[order], begins, dtype=np.int64).tolist() if len(order) else []
        columns = (index[places].tolist(), _talks(rows.take(places)).tolist(), frames, bits)
        for second, code, count, length in zip(*columns, strict=True):
            one = bus.open.setdefault(second, _Second((self._origin or 0) + second * SECOND))
            one.add(code, count, length, sign)
        newest = max(bus.open, default=0)
        self._close(bus, [one for one in bus.open if one < newest - _LATE])

    def _close(self, bus: _BusLoad, starts: Iterable[int]) -> None:
        for start in sorted(starts):
            self._tell(bus, bus.open.pop(start))

    def _tell(self, bus: _BusLoad, second: _Second) -> None:
        if not second.frames:
            return
        bus.bits.feed(np.array([second.bits]))
        if bus.worst is None or second.bits > bus.worst.bits:
            bus.worst = second
        if len(bus.seconds) < MOST_SECONDS:
            types: dict[int, int] = {}
            for code, (_, bits) in second.by.items():
                types[code >> 8] = types.get(code >> 8, 0) + bits
            most = max(types, key=lambda code: (types[code], -code))
            bus.seconds.append((second.start, second.frames, second.bits, most, types[most]))
        for text, limit, frames in self._limits:
            if (second.frames if frames else percent(second.bits, self._bit_rate)) > limit:
                bus.passed[text] = bus.passed.get(text, 0) + 1


def _talks(rows: ChosenFrames) -> Array:
    """Return sender and type of each frame as one number: type code + 1 << 8 | node, 0 of what is not DroneCAN."""
    node, code = who(rows.id, rows.flags, rows.verdict)
    found: Array = np.where(code == NOBODY, _OTHER, code + 1 << 8 | np.maximum(node, 0))
    return found


def _sender(registry: Registry, code: int) -> tuple[str | None, str]:
    if code >> 8 == _OTHER:
        return None, "not DroneCAN"
    kind, type_id = (code >> 8) - 1 >> 16, (code >> 8) - 1 & 0xFFFF
    return str(code & 0xFF), type_of(registry, kind, type_id)


def _limits(registry: Registry, bit_rate: int) -> Iterator[tuple[str, float, bool]]:
    """Yield the limits that rules have for a second of a bus: in words, the number, and whether it counts frames."""
    for rule, page in sorted(rule_pages(registry).items()):
        if "load_pct" in page.values:
            for number in page.settings.values():
                yield f"above {number:g} % ({rule})", number, False
        elif "limit_per_s" in page.settings and page.text.startswith(_RATE):
            number = page.settings["limit_per_s"] * min(1.0, bit_rate / 1_000_000)
            yield f"above {number:g} frames ({rule}: {page.title.lower()})", number, True
