"""The columns that a profile makes of a layout, as a description that the native core runs.

A description is compiled once for a type or packet: for each column its name, type and metadata, and what the core has
to do for it (show a field, scaled or not, cut bits out of a word, read bytes as text, compute a derived value).
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer import _native
from dissectors.kit.cells import numbers
from dissectors.layout import ArrayType, CompoundType, PrimitiveType, plan

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping
    from fractions import Fraction

    import numpy.typing as npt

    from analyzer._native import Cells
    from dissectors.kit import Array
    from dissectors.layout import Type
    from dissectors.schema import Bits, Derived, Note


_WIDTHS = (8, 16, 32, 64)
_WORD = (1 << 64) - 1


class Description:
    """The columns of one layout: `fields` have their names, types and metadata, `native` makes them."""

    def __init__(self, layout: CompoundType, notes: Mapping[str, Note], derived: Iterable[Derived]) -> None:
        self.native = _native.Decoder(plan(layout))
        self.fields: list[pa.Field] = []
        self._layout, self._notes = layout, notes
        self._places = {member.name: k for k, member in enumerate(layout.fields) if not _is_void(member.type)}
        for name, place in self._places.items():
            self._field(name, place, notes.get(name))
        for rule in derived:
            self._derive(rule, notes.get(rule.source))

    def unwrapped(self, unit_at: int) -> Iterator[pa.Field]:
        """Add `<field>.unwrapped` of counters that wrap behind all columns, by the byte at `unit_at`; yield them."""
        for name, place in self._places.items():
            note, of = self._notes.get(name), self._layout.fields[place].type
            if note is not None and note.wraps and isinstance(of, PrimitiveType):
                self.native.unwrap(place, of.bits, unit_at, None if note.scale is None else _steps(note.scale))
                about = metadata(unit=note.unit, clause=note.clause, source=name)
                kind = pa.uint64() if note.scale is None else pa.float64()
                yield pa.field(f"{name}.unwrapped", kind, metadata=about)

    def expect_length(self, counted: tuple[int, bytes] | None) -> None:
        """Look for a length in front of the tail array: a byte at a place, before a header, or what makes rows fit."""
        if counted is not None:
            self.native.length_counts(*counted)
            return
        limited = [(place, self._notes[name]) for name, place in self._places.items() if name in self._notes]
        self.native.length_fits(
            [
                (place, *_limits(note.low, note.high), _words(note.special))
                for place, note in limited
                if note.low is not None or note.high is not None
            ]
        )

    def _add(self, name: str, kind: pa.DataType, about: Mapping[str, str] | None = None) -> None:
        self.fields.append(pa.field(name, kind, metadata=about))

    def _field(self, name: str, place: int, note: Note | None) -> None:
        """Add a field, followed by its parts, and by what else its note makes of it."""
        scales: list[tuple[list[int], tuple[float, float, float]]] = []
        of = self._layout.fields[place].type
        kind = _shown(of, name, [], self._notes if note is None else {name: note}, scales)
        self.native.show(place, scales)
        if note is None:
            self._add(name, kind)
            return
        about = metadata(
            unit=note.unit, enum={**note.enum, **note.special}, clause=note.clause, name=note.name,
            text="yes" if note.text else "", hex="yes" if note.hex else "",
        )  # fmt: skip
        self._add(name, kind, about)
        for part in note.parts:
            self._part(name, place, part, _words(note.special))
        if note.text:
            self.native.text(place)
            self._add(f"{name}.text", pa.string(), about)
        if note.unit_by is not None:
            self._measured(name, place, note)

    def _part(self, name: str, place: int, part: Bits, without: list[int]) -> None:
        """Add bits of a word; one with a special value has no parts."""
        if part.flag:
            self.native.flag(place, part.low, without)
            kind = pa.bool_()
        else:
            steps = None if part.scale is None else _steps(part.scale)
            self.native.part(place, part.low, part.width, without, steps)
            kind = _integer("u", part.width) if part.scale is None else pa.float64()
        about = metadata(unit=part.unit, enum=part.enum, clause=part.clause, tentative="yes" if part.tentative else "")
        self._add(f"{name}.{part.name}", kind, about)

    def _measured(self, name: str, place: int, note: Note) -> None:
        """Add a value whose unit follows another field, as number and unit."""
        assert note.unit_by is not None  # noqa: S101 - the caller has looked
        rows = [(mode, of.scale or 1, of.unit) for mode, of in note.unit_by.table.items()]
        measures = [(mode, _steps(scale), float(scale), unit) for mode, scale, unit in rows]
        self.native.measured(place, self._places[note.unit_by.field], measures)
        self._add(f"{name}.value", pa.float64(), {"clause": note.clause})
        self._add(f"{name}.unit", pa.string(), {"clause": note.clause})

    def _derive(self, rule: Derived, note: Note | None) -> None:
        place = self._places[rule.source]
        if rule.format == "date":
            self.native.day(place, rule.element)
            kind = pa.string()
        else:
            pieces = [(*_limits(one.start, one.stop), float(one.add)) for one in rule.pieces]
            without = _words(note.special) if note is not None else []
            steps, limits = _steps(rule.scale, rule.offset), _limits(rule.low, rule.high)
            self.native.derive(place, rule.element, steps, pieces, limits, without)
            kind = pa.float64()
        if rule.element is None and isinstance(self._layout.fields[place].type, ArrayType):
            kind = pa.list_(kind)
        self._add(rule.name, kind, metadata(unit=rule.unit, clause=rule.clause, source=rule.source))


class Assembler:
    """Names and types what the core hands over."""

    def __init__(self, fields: Iterable[pa.Field], about: Mapping[str, str]) -> None:
        self.schema = pa.schema(_renamed(fields), metadata=about)

    def table(self, message: Cells) -> pa.RecordBatch:
        """Return a message of Arrow's IPC format as a table, without a copy."""
        return pa.ipc.read_record_batch(message, self.schema)


def _renamed(fields: Iterable[pa.Field]) -> list[pa.Field]:
    """Rename a field that is called like a column in front of it: `src` becomes `src.field`."""
    out: dict[str, pa.Field] = {}
    for one in fields:
        own = one if one.name not in out else one.with_name(f"{one.name}.field")
        out[own.name] = own
    return list(out.values())


def _is_void(kind: Type) -> bool:
    return isinstance(kind, PrimitiveType) and kind.kind == "void"


def _steps(scale: Fraction | int, offset: Fraction | int = 0) -> tuple[float, float, float]:
    return float(scale.numerator), float(scale.denominator), float(offset)


def _limits(low: Fraction | None, high: Fraction | None) -> tuple[float, float]:
    return -np.inf if low is None else float(low), np.inf if high is None else float(high)


def _words(values: Collection[int]) -> list[int]:
    """Return raw values as the core compares them: in two's complement."""
    return [value & _WORD for value in values]


def _shown(
    kind: Type, path: str, at: list[int], notes: Mapping[str, Note],
    scales: list[tuple[list[int], tuple[float, float, float]]],
) -> pa.DataType:  # fmt: skip
    """Return the Arrow type of a field as it is shown; add the numbers in it that have a scale to `scales`."""
    if isinstance(kind, CompoundType):
        inner = [(k, m) for k, m in enumerate(kind.fields) if not _is_void(m.type)]
        shown = [(m.name, _shown(m.type, f"{path}.{m.name}", [*at, k], notes, scales)) for k, m in inner]
        return pa.struct([pa.field(name, of) for name, of in shown])
    if isinstance(kind, ArrayType):
        return pa.list_(_shown(kind.element, path, at, notes, scales))
    note = notes.get(path)
    if note is None or note.scale is None:
        return arrow_type(kind)
    scales.append((at, _steps(note.scale)))
    return pa.float64()


def _integer(sign: str, bits: int) -> pa.DataType:
    width = next(width for width in _WIDTHS if width >= bits)
    return getattr(pa, f"{sign}int{width}")()


def arrow_type(layout: Type) -> pa.DataType:
    """Return the Arrow type of a DSDL type: smallest integer that fits, float16 as float32, arrays as lists."""
    if isinstance(layout, PrimitiveType):
        if layout.kind == "float":
            return pa.float64() if layout.bits == 64 else pa.float32()
        if layout.kind == "bool":
            return pa.bool_()
        return _integer("u" if layout.kind == "uint" else "", layout.bits)
    if isinstance(layout, ArrayType):
        return pa.list_(arrow_type(layout.element))
    return pa.struct([pa.field(m.name, arrow_type(m.type)) for m in members(layout)])


NODES = 1 << 16  # numbers that `senders` gives


def senders(table: pa.RecordBatch) -> Array:
    """Return the sending node of every row, u16: bus and source node ID."""
    nodes: Array = numbers(table.column("bus")).astype(np.uint16) << np.uint16(8) | numbers(table.column("src"))
    return nodes


def members(layout: CompoundType) -> list[Any]:
    """Return the fields that have a value: all but the voids."""
    return [m for m in layout.fields if not _is_void(m.type)]


def metadata(*, unit: str = "", enum: Mapping[int, str] | None = None, **texts: str) -> dict[str, str]:
    """Return Arrow field metadata; empty entries are left out."""
    out = {"unit": unit, "enum": json.dumps({str(k): v for k, v in (enum or {}).items()}) if enum else "", **texts}
    return {key: value for key, value in out.items() if value}


def linear(raw: Array, scale: Fraction, offset: Fraction | int = 0) -> npt.NDArray[np.float64]:
    """Return raw * scale + offset; multiplied first, so that hundredths come out as the nearest float."""
    with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN
        values: npt.NDArray[np.float64] = np.multiply(raw, float(scale.numerator), dtype=np.float64)
    if scale.denominator != 1:
        values /= scale.denominator
    if offset:
        values += float(offset)
    return values
