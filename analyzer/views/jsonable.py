"""Decoded rows as JSON values, a column at a time.

Messages give what was on the wire: raw numbers by DSDL field name. Packets give physical values and text. In both a
field whose values have names, or that has bit parts, becomes an object with `raw`, and with `read_as` where the node
means something else than these names. The parts of a special value are null.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from analyzer.decode.readings import reading_column
from analyzer.facts.json_number import number
from analyzer.facts.meaning import meaning
from analyzer.views.members import cells
from dissectors.kit.cells import pylist, step_into
from dissectors.schema import ArrayType, CompoundType, Message, PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Mapping
    from fractions import Fraction

    from analyzer.views.rows import MessagePart
    from dissectors.schema import Bits, Note, Packet, Type


def field_objects(part: MessagePart, *, physical: bool) -> list[dict[str, Any]]:
    """Return the fields of every row of a table; `physical` scales numbers and reads texts, as packets are shown."""
    if part.of is None:
        reasons, data = pylist(part.table.column("reason")), pylist(part.table.column("data"))
        return [{"reason": r, "data": d.hex().upper()} for r, d in zip(reasons, data, strict=True)]
    columns = {
        m.name: _field(part, part.of, m.name, m.type, physical=physical) for m in part.of.layout.fields if m.name
    }
    if part.of.layout.union:
        return [_active(dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True)]
    if not columns:
        return [{} for _ in range(len(part.table))]
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def derived_objects(part: MessagePart, *, physical: bool) -> list[dict[str, Any]]:
    """Return of every row what follows from its fields: `derived`, `units` and `texts`, each by column.

    `derived` are the computed columns, and the values in their units of fields that are raw numbers elsewhere; those of
    packets are `physical` there, too. `texts` name special values, such as "no change".
    """
    rows: list[dict[str, Any]] = [{"derived": {}, "units": {}, "texts": {}} for _ in range(len(part.table))]
    if part.of is None:
        return rows
    for name, note in part.of.notes.items():
        if not physical and (note.scale is not None or note.unit_by is not None):
            _put(rows, "derived", name, cells(part, f"{name}.value" if note.unit_by is not None else name))
        if note.unit_by is not None and not physical:
            _put(rows, "units", name, cells(part, f"{name}.unit"))
        if note.wraps:
            _put(rows, "derived", f"{name}.unwrapped", cells(part, f"{name}.unwrapped"))
        units = {name: note.unit} | {f"{name}.{bits.name}": bits.unit for bits in note.parts}
        units |= {f"{name}.unwrapped": note.unit} if note.wraps else {}
        _put_units(rows, units)
        if note.special:
            texts = meaning(part.of, name).texts
            special = {value: text for value, text in texts.items() if text in note.special.values()}
            _put_texts(rows, name, cells(part, name), special)
    for derived in part.of.derived:
        _put(rows, "derived", derived.name, cells(part, derived.name))
        _put_units(rows, {derived.name: derived.unit})
        _put_texts(rows, derived.name, cells(part, derived.source), _special(part.of.notes.get(derived.source)))
    return rows


def _special(note: Note | None) -> Mapping[float, str]:
    return {} if note is None else {raw: text for raw, text in note.special.items()}  # noqa: C416 - int keys to float


def _put(rows: list[dict[str, Any]], key: str, name: str, values: list[Any]) -> None:
    for row, value in zip(rows, values, strict=True):
        row[key][name] = _numbers(value)


def _numbers(value: Any) -> Any:
    if isinstance(value, list):
        return [_numbers(cell) for cell in value]
    return number(value) if isinstance(value, float) else value


def _put_units(rows: list[dict[str, Any]], units: Mapping[str, str]) -> None:
    known = {name: unit for name, unit in units.items() if unit not in ("", "unspecified")}
    for row in rows if known else ():
        row["units"] |= known


def _put_texts(rows: list[dict[str, Any]], name: str, values: list[Any], texts: Mapping[float, str]) -> None:
    for row, value in zip(rows, values, strict=True) if texts else ():
        if isinstance(value, (int, float)) and value in texts:
            row["texts"][name] = texts[value]


def _field(part: MessagePart, of: Message | Packet, name: str, kind: Type, *, physical: bool) -> list[Any]:
    note = of.notes.get(name)
    values = pylist(part.table.column(part.own(name)))
    if note is not None and physical and note.text:
        return pylist(part.table.column(f"{name}.text"))
    raw = _unscaled(values, kind, note.scale) if note is not None and note.scale is not None else values
    if note is not None and physical and note.unit_by is not None:
        value, unit = pylist(part.table.column(f"{name}.value")), pylist(part.table.column(f"{name}.unit"))
        rows = zip(raw, value, unit, strict=True)
        return [None if r is None else {"raw": r, "value": v, "unit": u} for r, v, u in rows]
    shown = values if physical else raw
    return _doubted(part, of, name, _column(kind, raw, shown, name, of))


def _doubted(part: MessagePart, of: Message | Packet, name: str, cells: list[Any]) -> list[Any]:
    """Say of a doubtful field where its node does not mean what the names say."""
    readings = of.readings if isinstance(of, Message) else ()
    for reading in readings:
        if reading.field == name and reading.noted:
            choices = pylist(part.table.column(reading_column(reading.name)))
            rows = zip(cells, choices, strict=True)
            cells = [
                one | {"read_as": choice} if choice != reading.noted and isinstance(one, dict) else one
                for one, choice in rows
            ]
    return cells


def _column(kind: Type, raw: list[Any], shown: list[Any], name: str, of: Message | Packet) -> list[Any]:
    """Convert a column; `raw` and `shown` are the same cells unless the field is scaled; what is nested never is."""
    if isinstance(kind, CompoundType):
        return _structures(kind, raw, name, of)
    note = None if "." in name else meaning(of, name).note  # nested types stay exactly as DSDL has them
    if isinstance(kind, ArrayType):
        if isinstance(kind.element, PrimitiveType) and kind.element.kind != "float" and not _named(note):
            return shown
        pairs = zip(raw, shown, strict=True)
        return [None if r is None else _column(kind.element, r, s, name, of) for r, s in pairs]
    if note is not None and (note.parts or note.enum):
        return _objects(raw, note)
    # A special value stays a number: the type of a key must not depend on the row.
    return [number(cell) for cell in shown] if any(isinstance(cell, float) for cell in shown) else shown


def _structures(kind: CompoundType, cells: list[Any], name: str, of: Message | Packet) -> list[Any]:
    columns: dict[str, list[Any]] = {}
    for member in kind.fields:
        if member.name:
            inner, path = step_into(cells, member.name), f"{name}.{member.name}"
            scale = of.notes[path].scale if path in of.notes else None
            raw = inner if scale is None else _unscaled(inner, member.type, scale)
            columns[member.name] = _column(member.type, raw, raw, path, of)
    rows = zip(*columns.values(), strict=True) if columns else iter([()] * len(cells))
    objects = [dict(zip(columns, row, strict=True)) for row in rows]
    return [
        None if cell is None else _active(made) if kind.union else made
        for cell, made in zip(cells, objects, strict=True)
    ]


def _objects(raw: list[Any], note: Note) -> list[dict[str, Any] | None]:
    """Return `raw`, then the bit parts, then `text`; a name is null when the value has none."""
    texts: Mapping[int, str] = {**note.enum, **note.special}
    out: list[dict[str, Any] | None] = []
    for cell in raw:
        if cell is None:
            out.append(None)
            continue
        made: dict[str, Any] = {"raw": cell}
        for bits in note.parts:
            made[bits.name] = None if cell in note.special else _part(cell, bits)
        if note.enum or cell in texts:
            made["text"] = texts.get(cell)
        out.append(made)
    return out


def _part(word: int, bits: Bits) -> Any:
    raw = word >> bits.low & (1 << bits.width) - 1
    if bits.enum:
        return {"raw": raw, "text": bits.enum.get(raw)}
    if bits.scale is not None:
        return float(raw * bits.scale)
    return bool(raw) if bits.flag else raw


def _named(note: Note | None) -> bool:
    return note is not None and bool(note.enum or note.scale is not None)


def _active(members: dict[str, Any]) -> dict[str, Any]:
    """Return of a union only the member that was sent."""
    return {name: value for name, value in members.items() if value is not None}


def _unscaled(values: list[Any], kind: Type, scale: Fraction) -> list[Any]:
    """Return raw numbers of a column that holds raw * scale."""
    whole = not (isinstance(kind, PrimitiveType) and kind.kind == "float")

    def one(value: Any) -> Any:
        if isinstance(value, list):
            return [one(cell) for cell in value]
        if value is None or not math.isfinite(value):
            return value
        raw = value * scale.denominator / scale.numerator
        return round(raw) if whole else raw

    return [one(value) for value in values]
