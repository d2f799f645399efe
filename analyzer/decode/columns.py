"""Unpacked columns to Arrow: types from the layout, then what the profile adds (scale, bit parts, derived values)."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from dissectors.kit.cells import numbers, valid
from dissectors.schema import ArrayType, CompoundType, PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence
    from fractions import Fraction

    import numpy.typing as npt

    from analyzer._native import Cells
    from dissectors.kit import Array
    from dissectors.schema import Bits, Derived, Note, Type

    Flat = tuple[int, Cells | None, Cells | None]

_WIDTHS = (8, 16, 32, 64)


def arrow_type(layout: Type) -> pa.DataType:
    """Return the Arrow type of a DSDL type: smallest integer that fits, float16 as float32, arrays as lists."""
    if isinstance(layout, PrimitiveType):
        width = next(w for w in _WIDTHS if w >= layout.bits)
        if layout.kind == "float":
            return pa.float64() if layout.bits == 64 else pa.float32()
        if layout.kind == "bool":
            return pa.bool_()
        return getattr(pa, f"{'u' if layout.kind == 'uint' else ''}int{width}")()
    if isinstance(layout, ArrayType):
        return pa.list_(arrow_type(layout.element))
    return pa.struct([pa.field(m.name, arrow_type(m.type)) for m in members(layout)])


def senders(table: pa.RecordBatch) -> Array:
    """Return the sending node of every row, u16: bus and source node ID."""
    nodes: Array = numbers(table.column("bus")).astype(np.uint16) << np.uint16(8) | numbers(table.column("src"))
    return nodes


def members(layout: CompoundType) -> list[Any]:
    """Return the fields that have a value: all but the voids."""
    return [m for m in layout.fields if not (isinstance(m.type, PrimitiveType) and m.type.kind == "void")]


def assemble(layout: Type, flat: Iterator[Flat]) -> pa.Array:
    """Return the next column of the native core's preorder list as an Arrow array of `arrow_type(layout)`."""
    rows, valid, values = next(flat)
    bitmap = None if valid is None else pa.py_buffer(valid)
    if isinstance(layout, CompoundType):
        children = [assemble(m.type, flat) for m in members(layout)]
        return pa.Array.from_buffers(arrow_type(layout), rows, [bitmap], children=children)
    buffers = [bitmap, pa.py_buffer(values or b"")]
    if isinstance(layout, ArrayType):
        return pa.Array.from_buffers(arrow_type(layout), rows, buffers, children=[assemble(layout.element, flat)])
    return pa.Array.from_buffers(arrow_type(layout), rows, buffers)


def metadata(*, unit: str = "", enum: Mapping[int, str] | None = None, **texts: str) -> dict[str, str]:
    """Return Arrow field metadata; empty entries are left out."""
    out = {"unit": unit, "enum": json.dumps({str(k): v for k, v in (enum or {}).items()}) if enum else "", **texts}
    return {key: value for key, value in out.items() if value}


def enrich(
    layout: CompoundType, arrays: Sequence[pa.Array], notes: Mapping[str, Note], derived: Sequence[Derived]
) -> list[tuple[pa.Field, pa.Array]]:
    """Return named columns with units: every field in wire order, each followed by its parts, then the derived ones."""
    raw = dict(zip((m.name for m in members(layout)), arrays, strict=True))
    out: list[tuple[pa.Field, pa.Array]] = []
    inside = {path for path, note in notes.items() if "." in path and note.scale is not None}
    for name, array in raw.items():
        note = notes.get(name)
        if note is None:
            within = {path for path in inside if path.startswith(f"{name}.")}
            whole = _scaled_inside(array, name, within, notes) if within else array
            out.append((pa.field(name, whole.type), whole))
            continue
        about = metadata(
            unit=note.unit, enum={**note.enum, **note.special}, clause=note.clause, name=note.name,
            text="yes" if note.text else "", hex="yes" if note.hex else "",
        )  # fmt: skip
        shown = array if note.scale is None else scaled(array, note.scale)
        out.append((pa.field(name, shown.type, metadata=about), shown))
        out += [_part(name, _ordinary(array, note), part) for part in note.parts]
        if note.text:
            out.append((pa.field(f"{name}.text", pa.string(), metadata=about), as_text(array)))
        if note.unit_by is not None:
            out += _measured(name, array, raw[note.unit_by.field], note)
    out += [_derive(raw[d.source], d, notes.get(d.source)) for d in derived]
    return out


def scaled(array: pa.Array, scale: Fraction, offset: Fraction | int = 0) -> pa.Array:
    """Return raw * scale + offset as float64, exact where the result has few decimals; lists element by element."""
    if pa.types.is_list(array.type):
        return _relist(array, scaled(array.values, scale, offset))
    return _masked(linear(numbers(array), scale, offset), array)


def _scaled_inside(array: pa.Array, path: str, within: Collection[str], notes: Mapping[str, Note]) -> pa.Array:
    """Return structures, or lists of them, with the members `within` scaled."""
    if pa.types.is_list(array.type):
        return _relist(array, _scaled_inside(array.values, path, within, notes))
    if pa.types.is_struct(array.type):
        members_ = [array.type.field(k) for k in range(array.type.num_fields)]
        made = [_scaled_inside(array.field(k), f"{path}.{one.name}", within, notes) for k, one in enumerate(members_)]
        fields = [pa.field(one.name, child.type) for one, child in zip(members_, made, strict=True)]
        bitmap = array.buffers()[0] if array.null_count else None
        return pa.Array.from_buffers(pa.struct(fields), len(array), [bitmap], offset=array.offset, children=made)
    scale = notes[path].scale if path in within else None
    return array if scale is None else scaled(array, scale)


def linear(raw: Array, scale: Fraction, offset: Fraction | int = 0) -> npt.NDArray[np.float64]:
    """Return raw * scale + offset; multiplied first, so that hundredths come out as the nearest float."""
    with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN
        values: npt.NDArray[np.float64] = np.multiply(raw, float(scale.numerator), dtype=np.float64)
    if scale.denominator != 1:
        values /= scale.denominator
    if offset:
        values += float(offset)
    return values


def as_text(array: pa.Array) -> pa.Array:
    """Return byte lists as text: printable ASCII up to the first NUL, else hexadecimal."""
    return pa.array([None if row is None else text_of(bytes(row)) for row in array.to_pylist()], pa.string())


def text_of(raw: bytes) -> str:
    """Return printable ASCII up to the first NUL, without padding blanks, else hexadecimal."""
    text = raw.partition(b"\0")[0].rstrip()
    return text.decode("ascii") if all(0x20 <= b < 0x7F for b in text) else raw.hex().upper()


def _masked(values: Array, like: pa.Array) -> pa.Array:
    """Return values with the null cells of `like`."""
    if like.null_count:
        return pa.array(values, mask=np.asarray(like.is_null()))
    return pa.array(values)


def _relist(array: pa.Array, child: pa.Array) -> pa.Array:
    buffers = array.buffers()
    return pa.Array.from_buffers(pa.list_(child.type), len(array), buffers[:2], offset=array.offset, children=[child])


def _ordinary(word: pa.Array, note: Note) -> pa.Array:
    """Return a word, null where it is a special value: that has no parts."""
    if not note.special:
        return word
    values = numbers(word)
    special = np.isin(values, tuple(note.special))
    return pa.array(np.where(special, 0, values), word.type, mask=special | ~valid(word)) if special.any() else word


def _part(name: str, word: pa.Array, part: Bits) -> tuple[pa.Field, pa.Array]:
    raw = numbers(word)
    value = (raw >> raw.dtype.type(part.low)) & raw.dtype.type((1 << part.width) - 1)
    array: pa.Array
    if part.scale is not None:
        array = _masked(linear(value, part.scale), word)
    elif part.flag:
        array = _masked(value.astype(bool), word)
    else:
        width = next(w for w in _WIDTHS if w >= part.width)
        array = _masked(value.astype(f"u{width // 8}"), word)
    about = metadata(unit=part.unit, enum=part.enum, clause=part.clause, tentative="yes" if part.tentative else "")
    return pa.field(f"{name}.{part.name}", array.type, metadata=about), array


def _measured(name: str, array: pa.Array, by: pa.Array, note: Note) -> list[tuple[pa.Field, pa.Array]]:
    """Return a value whose unit follows another field, as number and unit."""
    assert note.unit_by is not None  # noqa: S101 - the caller has looked
    values: list[float | None] = []
    units: list[str | None] = []
    for raw, mode in zip(array.to_pylist(), by.to_pylist(), strict=True):
        measure = note.unit_by.table.get(mode)
        if raw is None or measure is None:
            values.append(None)
            units.append(None)
        else:
            values.append(float(raw * (measure.scale or 1)))
            units.append(measure.unit)
    about = {"clause": note.clause}
    return [
        (pa.field(f"{name}.value", pa.float64(), metadata=about), pa.array(values, pa.float64())),
        (pa.field(f"{name}.unit", pa.string(), metadata=about), pa.array(units, pa.string())),
    ]


def _derive(source: pa.Array, rule: Derived, note: Note | None) -> tuple[pa.Field, pa.Array]:
    about = metadata(unit=rule.unit, clause=rule.clause, source=rule.source)
    if rule.element is not None:
        source = _element(source, rule.element)
    if rule.format == "date":
        dates = pa.array([_date(raw) for raw in source.to_pylist()], pa.string())
        return pa.field(rule.name, pa.string(), metadata=about), dates
    special = tuple(note.special) if note else ()
    if pa.types.is_list(source.type):
        array = _relist(source, _converted(source.values, rule, special))
    else:
        array = _converted(source, rule, special)
    return pa.field(rule.name, array.type, metadata=about), array


def _element(lists: pa.Array, place: int) -> pa.Array:
    """Return one element of each list, null where there are fewer."""
    ends = np.asarray(lists.offsets).astype(np.int64)
    at = ends[:-1] + place
    return lists.values.take(pa.array(at, mask=at >= ends[1:]))


def _converted(source: pa.Array, rule: Derived, special: tuple[int, ...]) -> pa.Array:
    raw = numbers(source)
    values = linear(raw, rule.scale, rule.offset)
    todo = np.ones(len(values) if rule.pieces else 0, bool)
    for piece in rule.pieces:
        low = -np.inf if piece.start is None else float(piece.start)
        high = np.inf if piece.stop is None else float(piece.stop)
        here = todo & (values >= low) & (values < high)
        values[here] += float(piece.add)
        todo &= ~here
    mask = np.isin(raw, special)
    if rule.low is not None:
        mask |= raw < float(rule.low)
    if rule.high is not None:
        mask |= raw > float(rule.high)
    return pa.array(values, mask=mask | np.asarray(source.is_null())) if mask.any() else _masked(values, source)


@lru_cache(maxsize=4096)
def _date(raw: int | None) -> str | None:
    """Return the day a number may name: YYYYMMDD, else Unix seconds from 2000 on, else none."""
    if raw is None:
        return None
    try:
        return datetime.strptime(str(raw), "%Y%m%d").replace(tzinfo=UTC).date().isoformat()
    except ValueError:
        pass
    if raw >= 946_684_800:  # 2000-01-01
        return datetime.fromtimestamp(raw, UTC).date().isoformat()
    return None
