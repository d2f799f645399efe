"""One line about each message or packet: the summary template of its type, filled in column by column."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import repeat
from typing import TYPE_CHECKING, Any

from analyzer.facts.meaning import Meaning, meaning, stands_for
from analyzer.views.members import cells
from analyzer.views.terminal import escape
from analyzer.views.wording import MISSING, formatter, plain, quantity
from dissectors import template
from dissectors.kit.cells import pylist

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analyzer.views.rows import MessagePart
    from dissectors.schema import Message, Packet

# Bounds of a line about a type without a template, and of bytes shown in a line.
FIELDS_SHOWN = 12
ITEMS_SHOWN = 20
BYTES_SHOWN = 64

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
