"""Rows of a large fleet, put into a store as if its captures had been judged: for questions about thousands of ESCs."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import date, timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer.fleet.tables import TABLES

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.fleet.store import ResultStore

FIRST_DAY = date(2026, 9, 1)
DAY_NS, HOUR_NS = 86400 * 10**9, 3600 * 10**9
_ZERO = {pa.string(): "", pa.int64(): 0, pa.float64(): 0.0, pa.bool_(): False}
_USUAL = {"temperature_median": 45.0, "current_per_krpm2": 1.6, "rpm_per_percent": 50.0}
_NOISE = {"temperature_median": 1.0, "current_per_krpm2": 0.015, "rpm_per_percent": 0.005}


@dataclass
class Made:
    """A fleet: one flight a day and vehicle, of an hour each.

    `firmware` gives that of a vehicle, `broken` the chance that a flight of a vehicle on a day breaks the rule TRF-003,
    `other` by what part or kelvin a quantity of an ESC differs (quantity, vehicle, ESC, day), and `flies` on which days
    a vehicle flies.
    """

    vehicles: int = 300
    escs: int = 8
    days: int = 24
    seed: int = 1
    firmware: Callable[[int], str] = lambda _: "2.7"
    broken: Callable[[int, int], float] = lambda _vehicle, _day: 0.0
    other: Callable[[str, int, int, int], float] = lambda *_: 0.0
    flies: Callable[[int, int], bool] = lambda _vehicle, _day: True
    rows: dict[str, list[dict[str, Any]]] = field(default_factory=dict)

    def into(self, store: ResultStore) -> None:
        """Write them."""
        chance = np.random.default_rng(self.seed)
        own = {name: chance.normal(0, noise, (self.vehicles, self.escs)) for name, noise in _NOISE.items()}
        for vehicle in range(self.vehicles):
            for day in range(self.days):
                if self.flies(vehicle, day):
                    self._flight(vehicle, day, own, chance)
        store.append({name: [_table(name, rows)] for name, rows in self.rows.items()})

    def _flight(self, vehicle: int, day: int, own: dict[str, Any], chance: np.random.Generator) -> None:
        key, name, firmware = f"{vehicle}-{day}", f"v{vehicle:03}", self.firmware(vehicle)
        start = (FIRST_DAY - date(1970, 1, 1)).days * DAY_NS + day * DAY_NS + 8 * HOUR_NS
        when = (FIRST_DAY + timedelta(day)).isoformat()
        self._add(
            "captures", key, url=f"/logs/{name}/{when}.log", sha256=key, vehicle=name, date=when, outcome="judged",
            verdict="pass", flights=1, flight_ns=HOUR_NS, at_ns=1, version="1", settings="s",
        )  # fmt: skip
        values = {
            quantity: _USUAL[quantity] * (1 if quantity == "temperature_median" else 1 + chance.normal(0, 0.1))
            for quantity in _USUAL
        }
        measured = {}
        for quantity, usual in values.items():
            off = own[quantity][vehicle] + chance.normal(0, _NOISE[quantity], self.escs)
            off += np.array([self.other(quantity, vehicle, esc, day) for esc in range(self.escs)])
            measured[quantity] = usual + off if quantity == "temperature_median" else usual * (1 + off)
        for esc in range(self.escs):
            self._add("nodes", key, bus="can0", node=11 + esc, software=firmware, role="ESC")
            of = {name: float(some[esc]) for name, some in measured.items()}
            others = {f"{name}_others": float(np.median(np.delete(some, esc))) for name, some in measured.items()}
            self._add("esc_health", key, flight=1, bus="can0", node=11 + esc, ch=esc + 1, software=firmware,
                      t_ns=start, n=1000, ran_s=3600.0, **of, **others)  # fmt: skip
        if chance.random() < self.broken(vehicle, day):
            self._add("findings", key, rule="TRF-003", title="A frame was lost", severity="error", bus="can0", node=11,
                      category="protocol", count=1)  # fmt: skip

    def _add(self, table: str, key: str, **values: Any) -> None:
        empty = {one.name: _ZERO[one.type] for one in TABLES[table]}
        self.rows.setdefault(table, []).append({**empty, "key": key, "run": "r", **values})


def _table(name: str, rows: list[dict[str, Any]]) -> pa.Table:
    return pa.Table.from_pylist(rows, TABLES[name])
