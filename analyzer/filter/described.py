"""The fields of a message or packet as a filter knows them, made of what describes its columns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pyarrow as pa

from analyzer.decode.columns import Description
from analyzer.facts.meaning import meaning
from analyzer.filter.fields import BYTES, FLAG, TEXT, FieldRef, Kind
from dissectors.layout import ArrayType, CompoundType
from dissectors.records import replace
from dissectors.schema import Message

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.facts.meaning import Meaning
    from dissectors.layout import Type
    from dissectors.schema import Packet

_OF_MESSAGES = {"bits_left": pa.int32(), "trusted": pa.bool_(), "decided": pa.bool_()}
_OF_PACKETS = {
    "packet_ok": pa.bool_(), "header_ok": pa.bool_(), "length_ok": pa.bool_(), "checksum_ok": pa.bool_(),
    "checksum_end": pa.uint8(), "count_step": pa.uint8(), "count_step_id": pa.uint8(), "offset": pa.uint32(),
    "big_endian": pa.bool_(), "decided": pa.bool_(),
}  # fmt: skip
_UNSPECIFIED = "unspecified"  # in place of a unit that the document does not name
_MANY = 1 << 16  # elements of a list whose length nobody limits


def fields_of(of: Message | Packet) -> Iterator[tuple[str, FieldRef]]:
    """Yield the fields of a message or packet with their names, display names too."""
    extra = dict(_OF_MESSAGES if isinstance(of, Message) else _OF_PACKETS)
    doubtful = of.readings if isinstance(of, Message) else of.numbers
    for name in () if doubtful else ("decided", "big_endian"):
        extra.pop(name, None)
    fields = [
        *Description(of.layout, of.notes, of.derived).fields,
        *(
            pa.field(
                f"{n}.unwrapped", pa.uint64() if note.scale is None else pa.float64(), metadata={"unit": note.unit}
            )
            for n, note in of.notes.items()
            if note.wraps
        ),
    ]
    if isinstance(of, Message):
        fields += [pa.field(f"reading.{reading.name}", pa.string()) for reading in of.readings]
    names = {field.name for field in fields}
    fields += [pa.field(name, kind) for name, kind in extra.items() if name not in names]
    for field in fields:
        for path, kind in _leaves(field.type, ()):
            dotted = ".".join((field.name, *path))
            ref = _ref(of, dotted, field, path, kind)
            if ref is None:
                continue
            yield dotted, ref
            for own, note in of.notes.items():
                if note.name and (dotted == own or dotted.startswith(f"{own}.")):
                    yield note.name + dotted.removeprefix(own), ref


def _leaves(kind: pa.DataType, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], pa.DataType]]:
    inner = kind.value_type if pa.types.is_list(kind) else kind
    if pa.types.is_struct(inner):
        for k in range(inner.num_fields):
            yield from _leaves(inner.field(k).type, (*path, inner.field(k).name))
    else:
        yield path, kind


def _ref(
    of: Message | Packet, dotted: str, field: pa.Field, path: tuple[str, ...], kind: pa.DataType
) -> FieldRef | None:
    found = meaning(of, dotted)
    about = {k.decode(): v.decode() for k, v in (field.metadata or {}).items()}
    clause = found.clause or about.get("clause", "")
    written = found.note is not None and found.note.text and pa.types.is_list(kind)
    leaf = kind.value_type if pa.types.is_list(kind) else kind
    if pa.types.is_list(leaf):
        return None
    if written or pa.types.is_string(leaf):
        column = field.name if path or not written else f"{field.name}.text"
        return FieldRef(dotted, "table", TEXT, column, path=path, clause=clause)
    sort = BYTES if _octets(found, kind) else FLAG if pa.types.is_boolean(leaf) else None
    made = sort or _numbers(found, leaf, found.unit or about.get("unit", ""))
    if sort is BYTES or pa.types.is_list(field.type) or pa.types.is_list(kind):
        made = replace(made, most=_most(of, (field.name, *path)))
    return FieldRef(dotted, "table", made, field.name, path=path, clause=clause)


def _most(of: Message | Packet, path: Sequence[str]) -> int:
    """Return how many elements a field has at most, of all lists that it lies in; `_MANY` if nothing limits them."""
    first, *rest = path
    source = next((one.source for one in of.derived if one.name == first), first)
    kind: Type = of.layout
    found = 1
    for step in (source, *rest):
        if not isinstance(kind, CompoundType):
            break
        kind = next((member.type for member in kind.fields if member.name == step), kind)
        if isinstance(kind, ArrayType):
            found, kind = found * kind.max, kind.element
    return found if found > 1 else _MANY


def _octets(found: Meaning, kind: pa.DataType) -> bool:
    hexadecimal = found.note is not None and found.note.hex
    return pa.types.is_binary(kind) or (hexadecimal and pa.types.is_list(kind) and kind.value_type == pa.uint8())


def _numbers(found: Meaning, leaf: pa.DataType, unit: str) -> Kind:
    """Return the kind of a number."""
    note, part = found.note, found.part
    scale = 1 if note is None or note.scale is None else note.scale
    low = high = None
    if pa.types.is_integer(leaf):
        bits = part.width if part is not None else leaf.bit_width
        signed = pa.types.is_signed_integer(leaf)
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    flags = [part for part in (() if note is None else note.parts) if part.flag]
    mask = sum(((1 << part.width) - 1) << part.low for part in flags)
    if note is not None and flags and len(flags) == len(note.parts):
        mask = high or mask  # bits without a name are flags of a word that has no others, too
    return Kind(
        "number",
        unit="" if unit == _UNSPECIFIED else unit,
        texts={value: (text,) for value, text in found.texts.items()},
        closed=bool(note.enum if note is not None else part.enum if part is not None else ()),
        special=() if note is None else tuple(float(raw * scale) for raw in note.special),
        low=low,
        high=high,
        whole=pa.types.is_integer(leaf),
        mask=mask,
    )
