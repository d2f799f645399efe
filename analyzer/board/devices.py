"""Devices, whatever they are: what their tables say of them, put together by the name that people call them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.board.sheet import DeviceSheet
from analyzer.board.snapshot import DeviceReading, DeviceRow, DeviceTable, Head, Latched, Tally
from analyzer.devices.units import Units
from analyzer.facts.node_status import NODE_STATUS
from dissectors import picture
from dissectors.kit import SECOND
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import pyarrow as pa

    from analyzer.board.sheet import Spoken
    from dissectors import Registry

_Quantity = tuple[str, str]  # and role


@dataclass(slots=True)
class _Row:
    """The words of several tables about one device; `speaks` is the table in which it most often speaks of itself."""

    first: Spoken
    speaks: Spoken | None = None
    readings: dict[_Quantity, tuple[int, DeviceReading]] = field(default_factory=dict)
    states: dict[str, None] = field(default_factory=dict)
    flags: dict[str, None] = field(default_factory=dict)


class DeviceStates:
    """Follows the tables that dissectors say hold quantities of devices.

    Args:
        registry: the types that frames are decoded with. Raises `ProfileError` for a wrong `plots.toml`.
    """

    def __init__(self, registry: Registry) -> None:
        pictures = picture.load(registry)
        self._quantities = pictures.quantities
        shown = {name: plot for name, plot in pictures.plots.items() if name != NODE_STATUS and not plot.parameters}
        self._units = Units()
        self._hidden: set[tuple[str, ...]] = set()
        self._sheets: dict[str, DeviceSheet] = {}
        for name, plot in shown.items():
            lines = tuple(line for line in plot.lines if not self._quantities[line.quantity].detail)
            self._sheets[name] = DeviceSheet(plot, registry.definition(name), lines)

    @property
    def beyond(self) -> int:
        """Devices that found no place."""
        return sum(sheet.beyond for sheet in self._sheets.values())

    def feed(self, tables: Mapping[str, pa.RecordBatch], buses: tuple[str, ...]) -> None:
        """Take the tables of a batch."""
        for name, table in tables.items():
            if (sheet := self._sheets.get(name)) is not None:
                sheet.feed(table, self._units, buses)

    def mark(self) -> None:
        """Let the lowest, the highest and the longest count anew."""
        for sheet in self._sheets.values():
            sheet.mark()

    def clear(self, now: int) -> None:
        """Hide devices that are stale until they are heard again."""
        alive, known = set(), set()
        for sheet in self._sheets.values():
            for one in sheet.spoken():
                known.add(one.unit.parts)
                if not one.stale(now):
                    alive.add(one.unit.parts)
        self._hidden |= known - alive

    def latched(self, now: int) -> Iterator[Latched]:
        """Give the flags that were set since the mark, and devices that were silent for long, or are."""
        for sheet in self._sheets.values():
            for one in sheet.spoken():
                for word, _ in sheet.words:
                    yield from word.latched(one.place, one.unit.title)
                gap, ended = one.gap
                if one.unit.parts in self._hidden or not sheet.reports:
                    continue
                if one.stale(now):
                    yield Latched("silence", one.unit.title, "silent", one.t, now, 1, now=True)
                elif gap > one.patience:
                    text = f"no status for {gap / SECOND:.1f} s"
                    yield Latched("silence", one.unit.title, text, ended - gap, ended, 1)

    def tables(
        self, now: int, buses: tuple[str, ...], ages: Mapping[tuple[str, int], int],
        found: Mapping[tuple[int, int], Tally],
    ) -> Iterator[DeviceTable]:  # fmt: skip
        """Give the devices of each kind; those that nobody but an idle commander speaks of are left out.

        `ages` are how long nodes have been silent by the clock, where that is known to be longer than it seems.
        """
        kinds: dict[str, list[DeviceSheet]] = {}
        for sheet in self._sheets.values():
            kinds.setdefault(sheet.plot.who.path, []).append(sheet)
        for kind, sheets in kinds.items():
            rows: dict[tuple[str, ...], _Row] = {}
            for sheet in sheets:
                _gather(sheet, rows)
            title = sheets[0].plot.who.title
            shown = [row for parts, row in rows.items() if self._shown(parts, row, now)]
            made = [self._row(row, title, now, (buses, ages), found) for row in shown]
            if made:
                heads = tuple(self._heads(sheets, made))
                yield DeviceTable(kind, title, heads, tuple(sorted(made, key=lambda row: (row.bus, row.number))))

    def _shown(self, parts: tuple[str, ...], row: _Row, now: int) -> bool:
        if parts in self._hidden:
            spoken = row.speaks or row.first
            if spoken.stale(now):
                return False
            self._hidden.discard(parts)
        if row.speaks is not None:
            return True
        return any(one.last or one.low or one.high for _, one in row.readings.values())

    def _row(
        self, row: _Row, title: str, now: int, heard: tuple[tuple[str, ...], Mapping[tuple[str, int], int]],
        found: Mapping[tuple[int, int], Tally],
    ) -> DeviceRow:  # fmt: skip
        speaks, unit, (buses, ages) = row.speaks, row.first.unit, heard
        spoken = speaks or row.first
        silent = ages.get((buses[spoken.bus], spoken.node), 0)
        return DeviceRow(
            bus=buses[spoken.bus],
            title=unit.title,
            label=unit.title.partition(f"{title} ")[2] or unit.title,
            number=unit.number,
            node=speaks.node if speaks else 0,
            readings={key: reading for key, (_, reading) in row.readings.items()},
            states=tuple(row.states),
            flags=tuple(row.flags),
            age=max(0, now - speaks.t, silent) if speaks else None,
            gap=speaks.gap[0] or None if speaks else None,
            found=found.get((speaks.bus, speaks.node), Tally()) if speaks else Tally(),
            stale=spoken.stale(max(now, spoken.t + silent)),
        )

    def _heads(self, sheets: list[DeviceSheet], rows: list[DeviceRow]) -> Iterator[Head]:
        """Return columns in the order of the quantities; what no device has is none."""
        known = {key for row in rows for key in row.readings}
        whole: dict[_Quantity, bool] = {}
        for sheet in sheets:
            for line, integer in zip(sheet.lines, sheet.whole, strict=True):
                key = line.quantity, line.role
                whole[key] = whole.get(key, True) and integer
        for name, quantity in self._quantities.items():
            for key, integer in whole.items():
                if key[0] == name and key in known:
                    yield Head(name, key[1], quantity.title, quantity.unit, integer)


def _gather(sheet: DeviceSheet, rows: dict[tuple[str, ...], _Row]) -> None:
    """Gather what a table says of each device; of two that give the same quantity the later one counts."""
    last, low, high = (one.T.tolist() for one in (sheet.last, sheet.low, sheet.high))
    for one in sheet.spoken():
        row = rows.setdefault(one.unit.parts, _Row(one))
        if sheet.reports and (row.speaks is None or one.rows > row.speaks.rows):
            row.speaks = one
        for line, now, least, most in zip(sheet.lines, last[one.place], low[one.place], high[one.place], strict=True):
            key = line.quantity, line.role
            if now == now and (key not in row.readings or row.readings[key][0] <= one.t):  # noqa: PLR0124 - NaN is not
                row.readings[key] = one.t, DeviceReading(now, _known(least), _known(most))
        for word, _ in sheet.words:
            row.states |= dict.fromkeys(word.states(one.place))
            row.flags |= dict.fromkeys(word.flags(one.place))


def _known(value: float) -> float | None:
    return None if np.isnan(value) else value
