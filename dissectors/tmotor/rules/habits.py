"""ESCStatus over a whole capture: how a node encodes floats, its unit of temperature, a word that counts errors."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from dissectors.conformance import Watcher, watches
from dissectors.tmotor.rules.reports import mode
from dissectors.tmotor.rules.rows import NODES, breach, sender, usable
from dissectors.tmotor.rules.series import Previous

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.conformance import Found, Occurrence, Table, Values, View, Words

_FLOATS = ("voltage", "current", "temperature")
_LOW_BITS = 7  # what the mask of 5.2 as printed never lets through
_UNITS = {"K": "kelvin", "degC": "degrees Celsius"}
# Where the bit fields of a C compiler stand in the little-endian word of bytes 11 to 14: first bit and width.
_C_SPEED, _C_THROTTLE, _C_INDEX, _C_PADDING = (0, 18), (18, 7), (25, 5), (30, 2)
_C_START, _C_END = 10, 14


def _first_rows(node: Words) -> Iterator[tuple[int, int]]:
    """Each node that is there, and the first of its rows."""
    codes, at = np.unique(node, return_index=True)
    yield from zip(codes.tolist(), at.tolist(), strict=True)


@dataclass(slots=True)
class _Coarse:
    """A node all of whose floats end in 000 so far; `different` are the first of its values."""

    place: Occurrence
    transfers: int = 0
    values: int = 0
    different: set[int] = field(default_factory=set)


class Encoder(Watcher):
    """float16 with a mantissa of 7 bits (5.2); nodes by bus and ID, so their number is bounded."""

    rules = ("TYP-009",)

    def __init__(self) -> None:
        self._fine = np.zeros(NODES, bool)  # nodes that sent another mantissa
        self._coarse: dict[int, _Coarse] = {}

    def look(self, view: View) -> Iterator[Found]:
        """Counts; nothing is certain before the end."""
        table = view.table("ESCStatus")
        if table is not None:
            rows = np.flatnonzero(usable(table))
            node = sender(table, rows)
            still = ~self._fine[node]
            if still.any():
                self._count(view, table, rows[still], node[still], int(view.number("TYP-009", "min_values")))
        yield from ()

    def _count(self, view: View, table: Table, rows: Words, node: Words, enough: int) -> None:
        with np.errstate(over="ignore"):
            codes = np.stack([table[name][rows].astype(np.float16).view(np.uint16) for name in _FLOATS])
        finite = codes >> 10 & 31 != 31
        self._fine[node[((codes & _LOW_BITS != 0) & finite).any(axis=0)]] = True
        for code, at in _first_rows(node):
            if self._fine[code]:
                self._coarse.pop(code, None)
                continue
            if code not in self._coarse:
                self._coarse[code] = _Coarse(breach(view, table, int(rows[at]), "TYP-009", {}, held=True))
            one, mine = self._coarse[code], node == code
            good = finite[:, mine]
            one.transfers += int(mine.sum())
            one.values += int(good.sum())
            if len(one.different) < enough:
                one.different.update(np.unique(codes[:, mine][good])[:enough].tolist())

    def settle(self, view: View) -> Iterator[Occurrence]:
        """Nodes with enough transfers and values."""
        transfers, different = (view.number("TYP-009", name) for name in ("min_transfers", "min_values"))
        for _, one in sorted(self._coarse.items()):
            if one.transfers >= transfers and len(one.different) >= different:
                yield replace(one.place, values={"values": one.values, "transfers": one.transfers})


@watches("TYP-010")
def low_bits_first(view: View) -> Iterator[Found]:
    """Reports that make sense as bit fields of a C compiler and have dirty padding (4.4.3)."""
    table = view.table("ESCStatus")
    if table is None:
        return
    found: dict[int, Values] = {}
    for row in np.flatnonzero(table["pad_nonzero"] & usable(table)).tolist():
        payload = view.transfers.payload(int(table.row[row]))
        reading = _c_reading(int.from_bytes(payload[_C_START:_C_END], "little"))
        if reading is not None:
            found[row] = reading
    if found:
        yield view.among_rows("TYP-010", table, np.array(list(found)), found.__getitem__)


def _c_reading(word: int) -> Values | None:
    speed, throttle, index, padding = (
        word >> low & (1 << width) - 1 for low, width in (_C_SPEED, _C_THROTTLE, _C_INDEX, _C_PADDING)
    )
    if padding or throttle > 100 or index > 19:
        return None
    sign = 1 << _C_SPEED[1] - 1
    return {"rpm": (speed ^ sign) - sign, "throttle": throttle, "esc_index": index}


class Temperature(Watcher):
    """States each node's unit of temperature, as its readings have it; at most one entry a node."""

    rules = ("TYP-301",)

    def __init__(self) -> None:
        self._lowest = np.full(NODES, np.inf, np.float32)
        self._highest = np.full(NODES, -np.inf, np.float32)
        self._places: dict[int, Occurrence] = {}

    def look(self, view: View) -> Iterator[Found]:
        """Widens the ranges."""
        table = view.table("ESCStatus")
        if table is not None:
            rows = np.flatnonzero(usable(table) & np.isfinite(table["temperature"]))
            node, degrees = sender(table, rows), table["temperature"][rows]
            for code, at in _first_rows(node):
                if code not in self._places:
                    self._places[code] = breach(view, table, int(rows[at]), "TYP-301", {}, held=True)
            np.minimum.at(self._lowest, node, degrees)
            np.maximum.at(self._highest, node, degrees)
        yield from ()

    def settle(self, view: View) -> Iterator[Occurrence]:
        """One statement a node."""
        for code, place in sorted(self._places.items()):
            choice = view.choice("ESCStatus", "temperature", code >> 7, code & 0x7F)
            name, _, forced = choice.partition(" ")
            unit = " ".join(filter(None, (_UNITS.get(name, name), forced)))
            lowest, highest = float(self._lowest[code]), float(self._highest[code])
            yield replace(place, values={"unit": unit, "lowest": lowest, "highest": highest})


@dataclass(slots=True)
class _Count:
    """The first rise of a node's word, and how often it rose."""

    place: Occurrence
    before: int
    value: int
    rises: int = 0


class Counter(Watcher):
    """A first word that only rises, in small steps, at least twice, and never shows a mode; an entry a node."""

    rules = ("TYP-307",)

    def __init__(self) -> None:
        self._other = np.zeros(NODES, bool)  # nodes whose word is no counter
        self._before = Previous(-1)
        self._counts: dict[int, _Count] = {}

    def look(self, view: View) -> Iterator[Found]:
        """Follows nodes that may count."""
        table = view.table("ESCStatus")
        if table is not None:
            rows = np.flatnonzero(usable(table))
            node, word = sender(table, rows), table["error_count"][rows]
            self._other[node[mode(word) - np.uint32(1) < 8]] = True
            still = ~self._other[node]
            if still.any():
                self._follow(view, table, rows[still], node[still])
        yield from ()

    def _follow(self, view: View, table: Table, rows: Words, node: Words) -> None:
        word = table["error_count"][rows].astype(np.int64)
        (before,), _ = self._before.take(node, word)
        step = np.where(before < 0, 0, word - before)
        self._other[node[(step < 0) | (step > view.number("TYP-307", "max_step"))]] = True
        for at in np.flatnonzero(step != 0).tolist():
            code = int(node[at])
            if self._other[code]:
                self._counts.pop(code, None)
            else:
                if code not in self._counts:
                    place = breach(view, table, int(rows[at]), "TYP-307", {}, held=True)
                    self._counts[code] = _Count(place, int(before[at]), int(word[at]))
                self._counts[code].rises += 1

    def settle(self, _view: View) -> Iterator[Occurrence]:
        """Nodes that counted to the end."""
        for code, one in sorted(self._counts.items()):
            if one.rises > 1 and not self._other[code]:
                yield replace(one.place, values={"before": one.before, "value": one.value})


WATCHERS: tuple[type[Watcher], ...] = (Encoder, low_bits_first, Temperature, Counter)
