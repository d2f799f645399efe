"""The health of each ESC in each flight, in figures that can be compared between flights and vehicles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.devices.rows import split
from analyzer.flight.clock import ANEW, RecordedClock
from analyzer.flight.motors.reports import EscReader, channel
from analyzer.flight.motors.steady import SteadySpeed, commanded, turning
from analyzer.flight.orders import CommandReader
from analyzer.flight.reports import EventOrder
from analyzer.flight.robust import against_others
from analyzer.flight.tables import ReportReader
from analyzer.flight.thresholds import lasting, threshold
from analyzer.stats.distribution import Distribution
from dissectors import picture
from dissectors.records import as_dict, dataclass, field, replace
from dissectors.times import MILLISECOND, SECOND

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.flight.flights import Flight
    from analyzer.flight.log import FlightEvent
    from analyzer.flight.motors.reports import EscReports
    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.picture import Plot

MOST_DEVICES, MOST_RUNS = 256, 256
_MEASURED = ("speed", "current", "temperature", "volts")
_COMPARED = (("speed_per_command", "tolerated_speed"), ("power_per_speed3", "tolerated_current"))
_HELD = MILLISECOND  # a gap below it is two reports of one moment


@dataclass(frozen=True, slots=True)
class EscHealth:
    """The figures of one ESC in one flight; None where its reports do not tell one.

    Currents are A, speeds rpm without their sign, temperatures degC, voltages V, of the reports in which it turned.
    `speed_per_command` is in rpm a percent, `current_per_speed2` in A/(1000 rpm)^2, `power_per_speed3`, which depends
    least on how fast it turned, in W/(1000 rpm)^3: medians of the `steady` reports, with an even speed above a floor.
    `lost` are reports missing by transfer IDs, `gap_p99_ms` is between two reports. `z_` say how far it is from the
    other ESCs of this flight, in robust standard deviations; None with fewer than three.
    """

    flight: int
    bus: int
    node: int
    ch: int | None
    type: str
    running_s: float
    reports: int
    current_median: float | None
    current_p95: float | None
    current_max: float | None
    speed_median: float | None
    speed_p95: float | None
    speed_max: float | None
    temperature_median: float | None
    temperature_p95: float | None
    temperature_max: float | None
    voltage_min: float | None
    steady: int
    speed_per_command: float | None
    current_per_speed2: float | None
    power_per_speed3: float | None
    lost: int
    gap_p99_ms: float | None
    faults: int = 0
    restarts: int = 0
    z_speed: float | None = None
    z_current: float | None = None
    z_temperature: float | None = None

    def plain(self) -> Mapping[str, Any]:
        """Return it as a row, by the names of its figures."""
        found: Mapping[str, Any] = as_dict(self)
        return found


@dataclass(slots=True)
class _Run:
    """The reports of one device in a time without a longer rest of all motors."""

    first: int
    last: int
    lost: int = 0
    measured: dict[str, Distribution] = field(default_factory=lambda: {name: Distribution() for name in _MEASURED})
    gaps: Distribution = field(default_factory=Distribution)
    per_command: Distribution = field(default_factory=Distribution)
    per_speed2: Distribution = field(default_factory=Distribution)
    per_speed3: Distribution = field(default_factory=Distribution)

    def join(self, other: _Run) -> None:
        """Take what another one has."""
        self.first, self.last = min(self.first, other.first), max(self.last, other.last)
        self.lost += other.lost
        for name, mine in self.measured.items():
            mine.join(other.measured[name])
        for name in ("gaps", "per_command", "per_speed2", "per_speed3"):
            getattr(self, name).join(getattr(other, name))


class _Device:
    """One device: its runs, by the number of the run."""

    def __init__(self, plot: Plot, key: int) -> None:
        self.plot, self.key = plot, key
        self.steady = SteadySpeed()
        self.runs: dict[int, _Run] = {}
        self._ran: int | None = None

    def feed(self, some: EscReports, on: Array, number: Array) -> None:
        """Add reports, those `on` of a motor that turns, and the number of the run that each is in."""
        steady = self.steady.feed(self.plot, some) & on
        gaps = np.diff(some.at.ran, prepend=some.at.ran[0] if self._ran is None else self._ran)
        self._ran = int(some.at.ran[-1])
        missing = np.where((some.at.step > 1) & (some.at.step != ANEW), some.at.step - 1, 0)
        for which in np.unique(number[on]).tolist():
            rows = np.flatnonzero(on & (number == which))
            run = self.runs.get(which)
            if run is None:
                run = self.runs[which] = _Run(int(some.at.ran[rows[0]]), int(some.at.ran[rows[0]]))
                rows_behind = rows[1:]  # what was before it is no gap of it
            else:
                rows_behind = rows
            run.last = max(run.last, int(some.at.ran[rows[-1]]))
            run.lost += int(missing[rows_behind].sum())
            run.gaps.feed(gaps[rows_behind][gaps[rows_behind] > _HELD] / MILLISECOND)
            for name, kept in run.measured.items():
                values = getattr(some, name)[rows]
                kept.feed(values[np.isfinite(values)])
            even = rows[steady[rows] & (some.speed[rows] >= threshold("steady_floor_rpm"))]
            throttle, speed, current = commanded(some)[even], some.speed[even], some.current[even]
            driven = throttle > threshold("motor_steady_percent")
            run.per_command.feed(speed[driven] / throttle[driven])
            drawn = current > threshold("motor_least_a")
            run.per_speed2.feed(current[drawn] / (speed[drawn] / 1000) ** 2)
            power = current * some.volts[even]
            run.per_speed3.feed((power / (speed / 1000) ** 3)[drawn & np.isfinite(power)])


class HealthFinder:
    """Adds up batches: `feed(batch)`, then `health(flights)`. Bounds: `MOST_DEVICES`, and `MOST_RUNS` of all together.

    Args:
        registry: the types. Raises `ProfileError` for a wrong `plots.toml`.
        reader: of the reports of each batch, if somebody else feeds it before; that of `EventFinder`.
    """

    def __init__(self, registry: Registry, reader: EscReader | None = None) -> None:
        self._clock = RecordedClock() if reader is None else None
        if self._clock is not None:
            plots = tuple(picture.load(registry).plots.values())
            self._commands = CommandReader(registry, plots, self._clock)
            order = EventOrder(registry, plots, self._clock, lambda _: None, ReportReader(registry, self._clock))
            reader = EscReader(order, self._commands)
        self._reader = reader
        self._devices: dict[tuple[str, int], _Device] = {}
        self._starts: list[int] = []  # recorded times at which motors began to turn, after a rest of all of them
        self._last: int | None = None

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        reader = self._reader
        if reader is None:
            return
        if self._clock is not None:
            self._clock.feed(batch)
            self._commands.feed(batch)
            reader.feed(batch)
        told = [(plot, key, some, turning(plot, some)) for plot, key, some in reader.now]
        self._follow([some.at.ran[on] for _, _, some, on in told])
        starts = np.array(self._starts, np.int64)
        for plot, key, some, on in told:
            device = self._devices.get((plot.table, key))
            if device is None:
                if len(self._devices) >= MOST_DEVICES:
                    continue
                device = self._devices[plot.table, key] = _Device(plot, key)
            number = np.maximum(np.searchsorted(starts, some.at.ran, "right") - 1, 0)
            device.feed(some, on, number)

    def health(self, flights: Sequence[Flight], events: Sequence[FlightEvent] = ()) -> list[EscHealth]:
        """Return the figures of each flight and ESC, after the last batch; faults and restarts are those of `events`.

        ESCs by interface, node and channel.
        """
        found: list[EscHealth] = []
        devices = sorted(self._devices.values(), key=lambda one: (one.key, one.plot.table))
        for flight in flights:
            rows = [_figures(flight, device, events) for device in devices]
            found += _compared([row for row in rows if row is not None])
        return found

    def _follow(self, times: Sequence[Array]) -> None:
        """Note where a run of all motors begins: they turn after a rest that separates flights."""
        ran = np.sort(np.concatenate([*times, np.zeros(0, np.int64)]))
        if not len(ran):
            return
        apart = np.diff(ran, prepend=ran[0] if self._last is None else self._last) > lasting("between_flights")
        if self._last is None:
            apart[0] = True
        self._starts += ran[apart][: MOST_RUNS - len(self._starts)].tolist()
        self._last = max(int(ran[-1]), self._last or 0)


def _figures(flight: Flight, device: _Device, events: Sequence[FlightEvent]) -> EscHealth | None:
    """Return what a device did in a flight, None if it did not turn in it."""
    inside = [run for run in device.runs.values() if flight.first.ran <= run.last and run.first <= flight.last.ran]
    if not inside:
        return None
    whole = _Run(inside[0].first, inside[0].last)
    for run in inside:
        whole.join(run)
    bus, node, _ = split(device.key)
    mine = [
        one.kind for one in events
        if (one.bus, one.node) == (bus, node) and flight.first.ran <= one.first.ran <= flight.last.ran
        and one.ch in {None, channel(device.plot, device.key)}
    ]  # fmt: skip
    volts, figures = whole.measured["volts"], {}
    for name in ("current", "speed", "temperature"):
        one = whole.measured[name]
        figures[f"{name}_median"], figures[f"{name}_p95"] = one.quantile(0.5), one.quantile(0.95)
        figures[f"{name}_max"] = one.high if one.count else None
    return EscHealth(
        flight=flight.number, bus=bus, node=node, ch=channel(device.plot, device.key), type=device.plot.table,
        running_s=(whole.last - whole.first) / SECOND, reports=max(one.count for one in whole.measured.values()),
        voltage_min=volts.low if volts.count else None, steady=whole.per_speed2.count,
        speed_per_command=whole.per_command.quantile(0.5), current_per_speed2=whole.per_speed2.quantile(0.5),
        power_per_speed3=whole.per_speed3.quantile(0.5), lost=whole.lost, gap_p99_ms=whole.gaps.quantile(0.99),
        faults=mine.count("fault"),
        restarts=mine.count("restart"), **figures,
    )  # fmt: skip


def _compared(rows: list[EscHealth]) -> list[EscHealth]:
    """Return them with how far each is from the others that report in the same type."""
    found = []
    for row in rows:
        others = [one for one in rows if one.type == row.type]
        z = {}
        for name, tolerated in _COMPARED:
            values = np.array([getattr(one, name) or np.nan for one in others])
            z[name] = against_others(100 * np.log(values), threshold(tolerated))
        warm = np.array([np.nan if one.temperature_median is None else one.temperature_median for one in others])
        z["temperature"] = against_others(warm, threshold("tolerated_temperature"))
        at = others.index(row)
        speed, current, temperature = (None if np.isnan(one[at]) else round(float(one[at]), 2) for one in z.values())
        found.append(replace(row, z_speed=speed, z_current=current, z_temperature=temperature))
    return found
