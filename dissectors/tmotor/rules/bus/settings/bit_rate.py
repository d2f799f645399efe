"""The bit rate: what ESCs have stored, what the bus runs at, what the printed timing gives."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import (
    MILLISECOND,
    NO_TIME,
    SECOND,
    Occurrence,
    Rule,
    breach,
    by_key,
    rows_by_bus,
    sender,
    usable,
)
from dissectors.records import replace
from dissectors.tmotor.rules.joined.joins import MOST_UNITS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, DecodedTable, Occurrences, View

_KBPS = (1000, 500, 250, 125, 100, 50)  # by code, 4.4.2 no 24
_BITS = 131  # of a frame with 29-bit identifier and 8 bytes, without stuff bits, with the pause behind it
_LEAST_NS = _BITS * 1000  # at the highest rate
_SLACK_NS = 2000  # of stamps in whole microseconds
_SAMPLED = 4096  # pairs of frames
_LOOKED_AT = 16 * _SAMPLED  # frames of a batch
_UNSEEN = (0, SECOND)  # pairs, and what is more than the least spacing of any
_LATE_SAMPLING = (500_000, 250_000, 125_000)


class StoredRate(Rule):
    """A stored bit rate that is not that of the bus.

    Without a known bit rate the spacing of 8-byte frames decides, if their times look like those of hardware: in 4096
    pairs none follow each other faster than 1 Mbps allows.
    """

    rules = ("BUS-019",)

    def __init__(self) -> None:
        self._waiting: dict[tuple[int, int, int], Occurrence] = {}  # (bus, node, code)
        self._spacing: dict[int, tuple[int, int]] = {}  # bus: pairs seen, the least spacing
        self._last: dict[int, tuple[int, bool]] = {}

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Compare each report with the known rate, or wait for the spacing."""
        table = view.table("ParamGet")
        if view.bit_rate is None and view.start != NO_TIME:
            self._measure(view)
        if table is not None:
            rows = _reports(table)
            if view.bit_rate is None:
                self._wait(view, table, rows)
            else:
                yield from self._judged(view, table, rows, view.bit_rate)

    def finish(self, _view: View) -> Iterable[Occurrences | Occurrence]:
        """Compare with the spacing of the whole capture's beginning."""
        for one in self._waiting.values():
            seen, least = self._spacing.get(one.bus, _UNSEEN)
            needed = _BITS * MILLISECOND // int(one.values["kbps"])
            if seen >= _SAMPLED and _LEAST_NS - _SLACK_NS <= least < needed - _SLACK_NS:
                evidence = f"8-byte frames follow every {least / 1000:.0f} us, {needed / 1000:.0f} us are needed"
                yield replace(one, values={**one.values, "evidence": evidence})

    def _judged(self, view: View, table: DecodedTable, rows: Array, bit_rate: int) -> Iterator[Occurrences]:
        codes = table["esc_can_rate"]
        wrong = rows[np.array(_KBPS)[codes[rows]] * 1000 != bit_rate]
        evidence = f"the bus runs at {bit_rate / 1000:g} kbps"
        if len(wrong):
            yield view.among_rows(
                "BUS-019", table, wrong, lambda row: {**_stored(int(codes[row])), "evidence": evidence},
                key=codes[wrong].astype(np.int64), each_named=True,
            )  # fmt: skip

    def _wait(self, view: View, table: DecodedTable, rows: Array) -> None:
        """Keep the first report of each node and code that is not that of the highest rate."""
        slower = rows[table["esc_can_rate"][rows] > 0]
        order, begins = by_key(sender(table, slower).astype(np.int64) << 8 | table["esc_can_rate"][slower])
        for row in np.sort(slower[order[begins]]).tolist():
            key = int(table.bus[row]), int(table.src[row]), int(table["esc_can_rate"][row])
            if key not in self._waiting and len(self._waiting) < MOST_UNITS:
                self._waiting[key] = breach(view, table, row, "BUS-019", _stored(key[2]), held=True)

    def _measure(self, view: View) -> None:
        """Measure the first pairs of 8-byte frames of each bus."""
        frames = view.frames
        if all(self._spacing.get(bus, _UNSEEN)[0] >= _SAMPLED for bus in range(len(view.buses))):
            return
        for bus, rows in rows_by_bus(frames.bus, frames.t):
            seen, least = self._spacing.get(bus, _UNSEEN)
            if seen >= _SAMPLED:
                continue
            picked = slice(_LOOKED_AT) if rows is None else rows[:_LOOKED_AT]
            full, t = (frames.length[picked] == 8) & (frames.flags[picked] & 9 == 1), frames.t[picked]
            before = self._last.get(bus, (int(t[0]), False))
            pairs = full & np.concatenate(([before[1]], full[:-1]))
            took = np.diff(t, prepend=before[0])[pairs][: _SAMPLED - seen]
            if len(took):
                least = min(least, int(took.min()))
            self._spacing[bus] = seen + len(took), least
            self._last[bus] = int(t[-1]), bool(full[-1])


class DifferentRates(Rule):
    """ESCs on one bus that have stored different bit rates."""

    rules = ("BUS-029",)

    def __init__(self) -> None:
        self._codes: dict[int, dict[int, int]] = {}

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Compare each new code with those of the other nodes; the rarer one is named last."""
        table = view.table("ParamGet")
        if table is None:
            return
        for row in _changed(table, _reports(table)).tolist():
            bus, node, code = int(table.bus[row]), int(table.src[row]), int(table["esc_can_rate"][row])
            codes = self._codes.setdefault(bus, {})
            if codes.get(node) == code:
                continue
            codes[node] = code
            others = sorted(other for other, its in codes.items() if its != code)
            if others:
                often = Counter(codes.values())
                rare = often[code] <= often[codes[others[0]]]
                first, second = (others[0], node) if rare else (node, others[0])
                values = {
                    "first_code": codes[first], "first_node": first,
                    "second_code": codes[second], "second_node": second,
                }  # fmt: skip
                yield breach(view, table, row, "BUS-029", values, node=second)


class SamplePoint(Rule):
    """The sample point that the printed timing gives at lower bit rates."""

    rules = ("BUS-033",)

    def finish(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Judge by the bit rate alone."""
        if view.bit_rate in _LATE_SAMPLING and view.buses:
            values = {"kbps": round(view.bit_rate / 1000)}
            yield Occurrence("BUS-033", view.start, 0, None, "", (), values)


def _reports(table: DecodedTable) -> Array:
    """Return the rows with a code that stands for a bit rate."""
    return np.flatnonzero(usable(table) & (table["esc_can_rate"] < len(_KBPS)))


def _stored(code: int) -> dict[str, object]:
    return {"code": code, "kbps": _KBPS[code]}


def _changed(table: DecodedTable, rows: Array) -> Array:
    """Return those that do not say what the one before of the same node has said."""
    order, begins = by_key(sender(table, rows))
    codes = table["esc_can_rate"][rows[order]]
    new = np.append(True, codes[1:] != codes[:-1])[: len(rows)]
    new[begins] = True
    found: Array = np.sort(rows[order[new]])
    return found
