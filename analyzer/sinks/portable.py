"""The tables as other tools want them: texts instead of codes, names instead of indexes, row numbers as columns.

Everything else keeps the name, type and metadata that it has in `analyzer.tables` and `analyzer.decode.columns`. Frame
numbers count from 1, as everywhere that people see them; transfers count from 0, as the messages refer to them.
"""

from __future__ import annotations

import json
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analyzer.tables import (
    BRS,
    ESI,
    EVENTS,
    EXTENDED,
    FD,
    FRAME_ANOMALIES,
    KINDS,
    REMOTE,
    RX,
    STATUSES,
    TRANSFER_ANOMALIES,
    TX,
    VERDICTS,
)
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dissectors import Registry
    from dissectors.kit import Array

    Column = tuple[pa.Field, pa.Array]

_BITS = {"extended": EXTENDED, "remote": REMOTE, "fd": FD, "brs": BRS, "esi": ESI}


def frames(table: pa.RecordBatch, rows: Array, buses: Sequence[str]) -> pa.RecordBatch:
    """Return frames with their numbers (`rows`, from 0); flags as columns of their own, verdict, anomaly in words."""
    flags = numbers(table.column("flags"))
    sent, received = flags & TX != 0, flags & RX != 0
    way = pa.array(sent.astype(np.uint8), mask=~(sent | received))
    out = [_column("frame", pa.array(rows + np.uint64(1)), "number, from 1"), *_columns(table, buses)]
    extra = [_column(name, _truths(flags & bit != 0), "a bit of flags") for name, bit in _BITS.items()]
    extra.append(_column("direction", _texts(way, ("rx", "tx")), "received or sent; null when not recorded"))
    at = 1 + table.schema.get_field_index("flags") + 1
    out[at:at] = extra
    return _batch(
        _in_words(out, {"verdict": VERDICTS}, {"anomaly": FRAME_ANOMALIES}),
        table.schema.metadata,
    )


def transfers(table: pa.RecordBatch, rows: Array, buses: Sequence[str], registry: Registry) -> pa.RecordBatch:
    """Return transfers with their numbers (`rows`, from 0), names of their types, numbers of their frames."""
    out = [_column("transfer", pa.array(rows), "number, from 0"), *_columns(table, buses)]
    names = [field.name for field, _ in out]
    of = names.index("frame")
    out[of] = _column("frames", _one_more(out[of][1]), "numbers of its frames, from 1")
    out.insert(names.index("kind") + 1, _column("type", _types(table, registry), "data type; null when unknown"))
    return _batch(
        _in_words(out, {"kind": KINDS, "status": STATUSES}, {"anomaly": TRANSFER_ANOMALIES}),
        table.schema.metadata,
    )


def events(table: pa.RecordBatch, buses: Sequence[str]) -> pa.RecordBatch:
    """Return events, their kind in words."""
    return _batch(_in_words(_columns(table, buses), {"kind": EVENTS}, {}), table.schema.metadata)


def found(table: pa.RecordBatch, buses: Sequence[str]) -> pa.RecordBatch:
    """Return findings, flights or their events; frames count from 1."""
    out: list[Column] = []
    for field, array in _columns(table, buses):
        if field.name in ("frame", "frame_end"):
            out.append(_column(field.name, pc.add(array, pa.scalar(1, array.type)), _from_1(field)))
        elif field.name == "frames":
            out.append(_column(field.name, _one_more(array), _from_1(field)))
        else:
            out.append((field, array))
    return _batch(out, table.schema.metadata)


def messages(table: pa.RecordBatch, buses: Sequence[str]) -> pa.RecordBatch:
    """Return messages or packets; behind each number that has names stands `<field>.text`.

    A member of a union that holds nothing is true where it was sent.
    """
    out: list[Column] = []
    present = set(table.schema.names)
    for field, array in _columns(table, buses):
        whole = _solid(array)
        out.append((field.with_type(whole.type), whole))
        names = _names(field)
        if names and f"{field.name}.text" not in present:
            about = {k: v for k, v in field.metadata.items() if k in (b"clause", b"tentative")}
            text = _named(array, names)
            out.append((pa.field(f"{field.name}.text", text.type, metadata=about), text))
    return _batch(out, table.schema.metadata)


def _one_more(lists: pa.Array) -> pa.Array:
    """Return lists of numbers, each of them larger by 1."""
    values = pc.add(lists.values, pa.scalar(1, lists.type.value_type))
    return pa.Array.from_buffers(lists.type, len(lists), lists.buffers()[:2], offset=lists.offset, children=[values])


def _from_1(field: pa.Field) -> str:
    about: str = field.metadata[b"about"].decode()
    return about.replace("from 0", "from 1")


def _columns(table: pa.RecordBatch, buses: Sequence[str]) -> list[Column]:
    out = list(zip(table.schema, table.columns, strict=True))
    if "bus" in table.schema.names:  # flights are of all of them
        at = table.schema.names.index("bus")
        out[at] = _column("bus", _texts(out[at][1], buses), "interface name")
    return out


def _in_words(
    columns: Iterable[Column], codes: dict[str, Sequence[str]], bits: dict[str, Sequence[str]]
) -> list[Column]:
    out = []
    for field, array in columns:
        if field.name in codes:
            out.append(_column(field.name, _texts(array, codes[field.name]), "in words"))
        elif field.name in bits:
            out.append(_column(field.name, _set_bits(array, bits[field.name]), "in words, joined by commas; or null"))
        else:
            out.append((field, array))
    return out


def _column(name: str, array: pa.Array, about: str) -> Column:
    return pa.field(name, array.type, metadata={"about": about}), array


def _batch(columns: Sequence[Column], about: Any) -> pa.RecordBatch:
    schema = pa.schema([field for field, _ in columns], metadata=about)
    return pa.RecordBatch.from_arrays([array for _, array in columns], schema=schema)


def _texts(codes: pa.Array, texts: Sequence[str]) -> pa.Array:
    places = {text: place for place, text in enumerate(dict.fromkeys(texts))}
    if len(places) < len(texts):  # where a text stood twice, Parquet files would get memory behind their dictionary
        codes = pa.array([places[text] for text in texts], pa.int32()).take(codes)
    # The core gives no code without a text: each cell would be looked at for that.
    return pa.DictionaryArray.from_arrays(codes, pa.array(list(places), pa.string()), safe=False)


def _truths(cells: Array) -> pa.Array:
    bits = pa.py_buffer(np.packbits(cells, bitorder="little"))
    return pa.Array.from_buffers(pa.bool_(), len(cells), [None, bits])


def _set_bits(array: pa.Array, names: Sequence[str]) -> pa.Array:
    bits = numbers(array)
    if not bits.any():
        return _texts(pa.nulls(len(bits), pa.int32()), ())
    some = np.flatnonzero(bits)
    found, inverse = np.unique(bits[some], return_inverse=True)
    codes = np.zeros(len(bits), np.int32)
    codes[some] = inverse
    texts = [", ".join(name for k, name in enumerate(names) if value >> k & 1) for value in found.tolist()]
    return _texts(pa.array(codes, mask=bits == 0), texts)


def _types(table: pa.RecordBatch, registry: Registry) -> pa.Array:
    codes = numbers(table.column("variant")).astype(np.uint32) << 24
    codes |= numbers(table.column("kind")).astype(np.uint32) << 16
    codes |= numbers(table.column("type_id"))
    encoded = pa.array(codes).dictionary_encode()  # hashed: to sort all of them takes longer
    found, ranks = np.unique(numbers(encoded.dictionary), return_inverse=True)
    inverse = ranks.astype(np.int32)[numbers(encoded.indices)]
    known = [registry.message(code >> 16 & 0xFF, code & 0xFFFF, code >> 24) for code in found.tolist()]
    missing = np.array([message is None for message in known], bool)
    texts = ["" if message is None else message.name for message in known]
    return _texts(pa.array(inverse, mask=missing[inverse]), texts)


def _names(field: pa.Field) -> dict[int, str]:
    """Return the names of an enumeration; one name alone, such as "no change", makes none."""
    if not pa.types.is_integer(field.type) or b"enum" not in (field.metadata or {}):
        return {}
    return _enumeration(field.metadata[b"enum"])


@lru_cache(maxsize=1024)
def _enumeration(text: bytes) -> dict[int, str]:
    names = {int(code): name for code, name in json.loads(text).items()}
    return names if len(set(names.values())) > 1 else {}


def _named(array: pa.Array, names: dict[int, str]) -> pa.Array:
    codes = sorted(names)
    values = numbers(array).astype(np.int64)
    at = np.searchsorted(codes, values).clip(max=len(codes) - 1)
    nameless = np.asarray(codes)[at] != values
    if array.null_count:
        nameless |= np.asarray(array.is_null())
    return _texts(pa.array(at.astype(np.int16), mask=nameless), [names[code] for code in codes])


@lru_cache(maxsize=1024)
def _hollow(kind: pa.DataType) -> bool:
    """Return True if it holds structures without members, which most formats cannot."""
    if pa.types.is_list(kind):
        return _hollow(kind.value_type)
    if not pa.types.is_struct(kind):
        return False
    return kind.num_fields == 0 or any(_hollow(kind.field(k).type) for k in range(kind.num_fields))


def _solid(array: pa.Array) -> pa.Array:
    """Return the same without hollow structures: a flag takes their place."""
    kind = array.type
    if not _hollow(kind):
        return array
    if pa.types.is_list(kind):
        inner = _solid(array.values)
        buffers = array.buffers()[:2]
        return pa.Array.from_buffers(pa.list_(inner.type), len(array), buffers, offset=array.offset, children=[inner])
    missing = pc.is_null(array)
    if kind.num_fields == 0:
        return pc.if_else(missing, pa.scalar(None, pa.bool_()), pa.scalar(True))
    inner = [_solid(array.field(k)) for k in range(kind.num_fields)]
    return pa.StructArray.from_arrays(inner, [kind.field(k).name for k in range(kind.num_fields)], mask=missing)
