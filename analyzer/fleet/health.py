"""The health of each ESC in each flight, in numbers that can be compared between flights, vehicles and firmware."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.devices.escs import Escs
from analyzer.fleet.tables import COMPARED
from dissectors.kit.cells import numbers, valid
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from dissectors import Registry
    from dissectors.kit import Array

_NUMBERS = ("commanded", "reported", "rpm", "voltage", "current", "temperature")
_MOST = 1 << 17  # reports of an ESC that are kept: beyond it every second one goes, so a day takes no more than an hour
_TURNING = 100.0  # rpm: below it a motor is not under way; the flights' own limit of idle is a vendor's
_FLOOR = 1000.0  # rpm: below it speed and current say more of friction and resolution than of propeller and motor
_STEADY = 0.03  # change of speed between reports, as a part: more is acceleration, which takes current of its own
_FEWEST = 10  # reports at steady speed of which a median is made
_LEAST_SPREAD = {"temperature_median": 1.0, "current_per_krpm2": 0.01, "rpm_per_percent": 0.01}
_IDS = 32


class EscHealth:
    """Collects what ESCs report, batch by batch, with a bounded number of reports each.

    Args:
        registry: the types. Raises `ProfileError` for a wrong `plots.toml`.
    """

    def __init__(self, registry: Registry) -> None:
        self._escs = Escs(registry)
        self._rows: dict[tuple[int, int, int], list[Array]] = {}
        self._kept: dict[tuple[int, int, int], int] = {}

    def feed(self, batch: Batch) -> None:
        """Take the reports of a batch."""
        rows = self._escs.feed(batch)
        if not len(rows):
            return
        rows = rows.filter(valid_mask(rows.column("t")))
        whole = (numbers(rows.column("transfer")) - np.uint64(batch.first_transfer)).astype(np.int64)
        step = batch.transfers.column("step")
        lost = np.where(valid(step)[whole], (numbers(step)[whole].astype(np.int64) - 1) % _IDS, 0)
        gap = batch.transfers.column("gap")
        apart = np.where(valid(gap)[whole], numbers(gap)[whole].astype(np.int64) / SECOND, np.nan)
        faults = np.array([bool(text) for text in rows.column("faults").to_pylist()], float)
        columns = [numbers(rows.column("t")).astype(np.int64).astype(float), lost.astype(float), apart, faults]
        columns += [_plain(rows.column(name)) for name in _NUMBERS]
        table = np.stack(columns, axis=1) if len(rows) else np.empty((0, len(columns)))
        bus, node = (numbers(rows.column(name)).astype(np.int64) for name in ("bus", "node"))
        ch = rows.column("ch")
        number = np.where(valid(ch), numbers(ch), -1).astype(np.int64)
        code = bus << 48 | node << 32 | (number + 1)
        for one in np.unique(code).tolist():
            key = one >> 48, one >> 32 & 0xFFFF, (one & 0xFFFFFFFF) - 1
            self._keep(key, table[code == one])

    def _keep(self, key: tuple[int, int, int], rows: Array) -> None:
        held = self._rows.setdefault(key, [])
        held.append(rows)
        self._kept[key] = self._kept.get(key, 0) + len(rows)
        if self._kept[key] > _MOST:
            every = np.concatenate(held)
            lost = every[:, 1].copy()
            thin = every[::2].copy()
            thin[:, 1] += np.append(lost[1::2], np.zeros(len(thin) - len(lost[1::2])))
            self._rows[key], self._kept[key] = [thin], len(thin)

    def rows(self, flights: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Return a row for each ESC and flight in which it turned; `flights` as in the store."""
        found = []
        for flight in flights:
            low, high = flight["t_ns"], flight["t_end_ns"]
            if low is None or high is None:
                continue
            here = [
                row
                for key, held in sorted(self._rows.items())
                if (row := _row(key, np.concatenate(held), flight["flight"], low, high)) is not None
            ]
            _compare(here)
            found += here
        return found


def valid_mask(column: pa.Array) -> pa.Array:
    """Return where a column has values."""
    return column.is_valid()


def _plain(column: pa.Array) -> Array:
    values: Array = np.where(valid(column), numbers(column).astype(float), np.nan)
    return values


def _row(key: tuple[int, int, int], rows: Array, flight: int, low: int, high: int) -> dict[str, Any] | None:
    rows = rows[(rows[:, 0] >= low) & (rows[:, 0] <= high)]
    if not len(rows):
        return None
    t, lost, gap, faults, commanded, reported, rpm, voltage, current, temperature = rows.T
    rpm = np.abs(rpm)
    on = rpm > _TURNING
    if not on.any():
        return None
    bus, node, ch = key
    told = np.where(np.isnan(commanded), reported, commanded)
    steady = on & (rpm > _FLOOR)
    steady[1:] &= np.abs(np.diff(rpm)) <= _STEADY * rpm[1:]
    row: dict[str, Any] = {
        "flight": flight, "bus": bus, "node": node, "ch": None if ch < 0 else ch, "t_ns": low,
        "ran_s": float(np.ptp(t[on])) / SECOND, "n": int(on.sum()),
    }  # fmt: skip
    for name, values in (("current", current), ("speed", rpm), ("temperature", temperature)):
        picked = values[on & ~np.isnan(values)]
        row |= dict(
            zip(
                (f"{name}_median", f"{name}_p95", f"{name}_max"),
                map(float, np.percentile(picked, (50, 95, 100))) if len(picked) else (None,) * 3,
                strict=True,
            )
        )
    volts = voltage[~np.isnan(voltage)]
    row["voltage_min"] = float(volts.min()) if len(volts) else None
    with np.errstate(divide="ignore", invalid="ignore"):
        row["rpm_per_percent"] = _median(np.where(told > 1, rpm / told, np.nan)[steady])
        row["current_per_krpm2"] = _median((current / (rpm / 1000) ** 2)[steady])
    row["faults"] = int(faults[0] + (np.diff(faults) > 0).sum())
    row["lost"] = int(lost[1:].sum())
    apart = gap[1:][~np.isnan(gap[1:])]
    row["gap_p99_s"] = float(np.percentile(apart, 99)) if len(apart) else None
    return row


def _median(values: Array) -> float | None:
    values = values[np.isfinite(values)]
    return float(np.median(values)) if len(values) >= _FEWEST else None


def _compare(rows: list[dict[str, Any]]) -> None:
    """Add how each ESC differs from the others of its flight; nothing where there are fewer than two others."""
    for name in COMPARED:
        for row in rows:
            others = np.array([one[name] for one in rows if one is not row and one[name] is not None])
            row[f"{name}_others"] = row[f"{name}_z"] = None
            if row[name] is None or len(others) < 2:
                continue
            middle = float(np.median(others))
            least = _LEAST_SPREAD[name] * (1 if name == "temperature_median" else abs(middle) or 1)
            spread = max(1.4826 * float(np.median(np.abs(others - middle))), least)
            row[f"{name}_others"], row[f"{name}_z"] = middle, (row[name] - middle) / spread
