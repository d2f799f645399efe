"""One line about each message or packet: the summary template of its type, filled in column by column."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import repeat
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer.facts.meaning import Meaning, meaning, stands_for
from analyzer.views.members import cells
from analyzer.views.terminal import display_width, escape, fit
from analyzer.views.wording import MISSING, formatter, plain, quantity
from dissectors import template
from dissectors.kit.cells import pylist
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.devices.remarks import Remarked
    from analyzer.views.rows import MessagePart
    from dissectors.schema import Message, Packet, Remark

# Bounds of a line about a type without a template, and of bytes shown in a line.
FIELDS_SHOWN = 12
ITEMS_SHOWN = 20
BYTES_SHOWN = 64
_LEAST_SUMMARY = 10
REMARK = "\x1f"  # in front of what is remarked: texts have no control characters

_slots = lru_cache(maxsize=1024)(template.parse)


def phrases(part: MessagePart) -> list[str]:
    """Write a line for each row; rows that no packet claims show their bytes."""
    if part.of is None:
        reasons, data = pylist(part.table.column("reason")), pylist(part.table.column("data"))
        return [f"{reason}: {octets(raw)}" for reason, raw in zip(reasons, data, strict=True)]
    if not part.of.summary:
        return _all_fields(part, part.of)
    pieces: list[Iterable[str]] = []
    for slot in _slots(part.of.summary):
        if slot.text:
            pieces.append(repeat(escape(slot.text)))
        if slot.column:
            pieces.append(_texts(part, slot.column, slot.format))
    return ["".join(row) for row, _ in zip(zip(*pieces, strict=False), range(len(part.table)), strict=False)]


def with_remarks(part: MessagePart, found: Sequence[Remarked]) -> list[str]:
    """Write a line for each row, and behind it, and a `REMARK`, what is remarked of the row."""
    lines = phrases(part)
    if part.of is None or not part.of.remarks:
        return lines
    said: list[list[str]] = [[] for _ in lines]
    for one in found:
        for row, text in zip(one.rows.tolist(), _said(part, one), strict=True):
            said[row].append(text)
    otherwise = [escape(remark.text) for remark in part.of.remarks if not remark.column]
    rows = zip(lines, said, strict=True)
    return [REMARK.join(filter(None, [line, ", ".join(some or otherwise)])) for line, some in rows]


def shortened(info: str, width: int) -> str:
    """Return a line in at most `width` columns; what is remarked is cut only after most of what stands before it."""
    whole = info.replace(REMARK, " ")
    summary, mark, _ = info.partition(REMARK)
    if not mark or display_width(whole) <= width:
        return fit(whole, width)
    rest = whole[len(summary) + 1 :]
    start = fit(summary, max(_LEAST_SUMMARY, width - 1 - display_width(rest)))
    return fit(f"{start} {rest}", width)


def _said(part: MessagePart, found: Remarked) -> list[str]:
    """Write what is remarked of rows; values that are the same are written once."""
    remark = found.remark
    own = all(slot.column.startswith(remark.column) or not slot.column for slot in _slots(remark.text))
    codes = found.raw if own else np.arange(len(found.rows))
    _, first, inverse = np.unique(codes, return_index=True, return_inverse=True)
    rows = pa.array(found.rows[first])
    texts = _remark_texts(replace(part, table=part.table.take(rows), at=[]), remark, found.raw[first].tolist())
    out = [texts[k] for k in inverse.tolist()]
    for row in np.flatnonzero(found.before >= 0).tolist():
        out[row] = f"{_name(part, remark.column, int(found.before[row]))} -> {out[row]}"
    return out


def _remark_texts(part: MessagePart, remark: Remark, raw: list[int]) -> list[str]:
    note = part.of.notes.get(remark.column) if part.of is not None else None
    if not remark.text and note is not None and any(bits.flag for bits in note.parts):
        return [", ".join(escape(b.called) for b in note.parts if b.flag and code >> b.low & 1) for code in raw]
    pieces: list[list[str]] = []
    for slot in _slots(remark.text or f"{{{remark.column}}}"):
        pieces.append([escape(slot.text)] * len(raw))
        if slot.column == remark.column and not slot.format:
            pieces.append([_name(part, slot.column, code) for code in raw])
        elif slot.column:
            pieces.append(_texts(part, slot.column, slot.format))
    texts = ["".join(row) for row in zip(*pieces, strict=True)]
    return [text.upper() if code in remark.capitals else text for code, text in zip(raw, texts, strict=True)]


def _name(part: MessagePart, column: str, raw: int) -> str:
    """Write one raw value of a column: its name, of a flag what it says, else the number in its unit."""
    about = meaning(part.of, column)
    if about.part is not None and about.part.flag:
        return escape(about.part.called if raw else f"no {about.part.called}")
    scale = next((one.scale for one in (about.note, about.part) if one is not None and one.scale is not None), None)
    value = raw if scale is None else float(raw * scale)
    named = about.part.enum if about.part is not None else about.note.enum if about.note is not None else {}
    text = about.texts.get(value, f"{raw} (undefined)" if named else plain(value))
    return quantity(escape(text), about.unit)


def octets(data: bytes, limit: int = BYTES_SHOWN) -> str:
    """Write bytes in hexadecimal, at most `limit` of them."""
    if not data:
        return "no data"
    return data[:limit].hex(" ").upper() + (f" ... {len(data)} bytes" if len(data) > limit else "")


def _texts(part: MessagePart, column: str, spec: str) -> list[str]:
    about = meaning(part.of, column)
    if about.note is not None and about.note.text and f"{column}.text" in part.table.schema.names:
        return [escape(text or MISSING) for text in cells(part, f"{column}.text")]
    if about.note is not None and about.note.unit_by is not None:
        return _measured(part, column, spec, about)
    try:
        values = cells(part, column)
    except KeyError:
        return [MISSING] * len(part.table)
    if isinstance(values[0] if values else None, float) and not about.texts and spec.endswith("f"):
        texts = _floats(values, spec)
    else:
        texts = list(map(formatter(spec, about.texts), values))
    source = part.of.notes.get(about.source) if part.of is not None and about.source else None
    if source is None or not (source.special or source.hex):
        return texts
    raws = cells(part, about.source)
    return [escape(stands_for(source, raw)) or text for raw, text in zip(raws, texts, strict=True)]


def _floats(values: list[Any], spec: str) -> list[str]:
    try:
        if all(map(math.isfinite, values)):
            return [format(value, spec) for value in values]
    except TypeError:  # a missing value among them
        pass
    return list(map(formatter(spec, {}), values))


def _measured(part: MessagePart, column: str, spec: str, about: Meaning) -> list[str]:
    """Write a value whose unit follows another field; raw where the unit is not known."""
    show = formatter(spec, about.texts)
    cell = zip(*(cells(part, name) for name in (column, f"{column}.value", f"{column}.unit")), strict=True)
    return [show(raw) if value is None else quantity(show(value), unit or "") for raw, value, unit in cell]


def _all_fields(part: MessagePart, of: Message | Packet) -> list[str]:
    columns = []
    for member in [m for m in of.layout.fields if m.name][:FIELDS_SHOWN]:
        texts = meaning(of, member.name).texts
        values = cells(part, member.name)
        columns.append([f"{member.name} {escape(_bounded(value, texts))}" for value in values])
    return [", ".join(row) for row in zip(*columns, strict=True)] if columns else [""] * len(part.table)


def _bounded(value: Any, texts: Any) -> str:
    if isinstance(value, list):
        if value and all(isinstance(cell, int) and 0x20 <= cell < 0x7F for cell in value):
            return '"' + bytes(value[:BYTES_SHOWN]).decode("ascii") + '"'
        more = f" ... {len(value)}" if len(value) > ITEMS_SHOWN else ""
        return "[" + " ".join(_bounded(cell, texts) for cell in value[:ITEMS_SHOWN]) + more + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} {_bounded(v, {})}" for k, v in value.items() if v is not None) + "}"
    return texts[value] if texts and value in texts else plain(value)
