"""Values as people read them: templates of single columns, with the names, formats and units of the profile."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from analyzer.facts.meaning import Meaning, meaning
from analyzer.views.members import ALL, NOTHING, PLAIN, CellTemplates, cells, whole
from analyzer.views.rows import MessagePart
from analyzer.views.terminal import escape
from analyzer.views.wording import MISSING, UNSPECIFIED, formatter

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from analyzer.views.members import Take
    from analyzer.views.sheets import SheetColumns, Template
    from dissectors.schema import Message, Note, Packet

# What the native renderer formats; anything else, such as thousands apart, is made ready for it.
_NATIVE = re.compile(r"([<>^]?)([+ -]?)(0?)(\d*)(?:\.(\d+))?([dxXefg])")


def named(texts: Mapping[float, str], otherwise: Template, take: Take = PLAIN) -> Template:
    """Return a template of values some of which have a name."""
    if not texts:
        return otherwise
    return ("switch", take, [(whole(value), ("text", escape(text))) for value, text in texts.items()], otherwise)


def value_template(of: Message | Packet, columns: SheetColumns, column: str, spec: str = "") -> Template:
    """Return the template of a column in the row of a table, in a format of Python; `-` for one that is not there."""
    about = meaning(of, column)
    if about.note is not None and about.note.text and f"{column}.text" in columns:
        return columns.of(f"{column}.text", ("instead", ("text", MISSING), ("copy",)))
    shown = _templates(spec, about.texts)
    if about.note is not None and about.note.unit_by is not None and f"{column}.value" in columns:
        value = shown.column(of, columns, f"{column}.value")
        unit = columns.of(f"{column}.unit", ("unlike", UNSPECIFIED, ("headed", "", " ", ("copy",))))
        raw = shown.column(of, columns, column)
        return ("given", columns.place(f"{column}.value"), ("all", [value, unit]), raw)
    try:
        found = shown.column(of, columns, column)
    except KeyError:
        return ("text", MISSING)
    if value_format(spec) is None:
        found = _ready(
            of, columns, column, formatter(spec, {value: escape(text) for value, text in about.texts.items()})
        )
    source = of.notes.get(about.source) if about.source else None
    return found if source is None else unless_special(of, columns, about.source, source, found)


def _templates(spec: str, texts: Mapping[float, str]) -> CellTemplates:
    def single(kind: pa.DataType, take: Take) -> Template:
        if pa.types.is_struct(kind):
            return _structure(kind)
        if pa.types.is_string(kind):
            return ("copy",)
        if pa.types.is_binary(kind):
            return ("hex", " ", ALL, "", "", "")
        return named(texts, ("number", take, value_format(spec) or ("plain",)), take)

    return CellTemplates(MISSING, single, lambda element: ("each", " ", ALL, "", element))


def _structure(kind: pa.DataType) -> Template:
    plain = _templates("", {})
    return ("all", [("text", "{"), ("joined", ", ", members(kind, plain.cell)), ("text", "}")])


def members(kind: pa.DataType, cell: Callable[[pa.DataType], Template]) -> list[Template]:
    """Return templates of the members of a structure by name; one without a value writes nothing."""
    inner = [kind.field(k) for k in range(kind.num_fields)]
    made = [("all", [("text", f"{one.name} "), ("of", k, cell(one.type))]) for k, one in enumerate(inner)]
    return [("given", k, one, NOTHING) for k, one in enumerate(made)]


def value_format(spec: str) -> Template | None:
    """Return how a number is written in a format of Python; None for one that the native renderer does not have."""
    found = _NATIVE.fullmatch(spec)
    if found is None:
        return None if spec else ("plain",)
    align, sign, zeros, width, digits, kind = found.groups()
    return ("format", align, sign or "-", bool(zeros), int(width or 0), None if digits is None else int(digits), kind)


def _ready(of: Message | Packet, columns: SheetColumns, column: str, cell: Callable[[Any], str]) -> Template:
    """Return a template of texts that are made of the cells for each batch."""

    def make(table: pa.RecordBatch) -> pa.Array:
        return pa.array(map(cell, cells(MessagePart("", of, table, []), column)), pa.string())

    return ("of", columns.computed(f"{column} as text", make), ("copy",))


def unless_special(of: Message | Packet, columns: SheetColumns, name: str, source: Note, value: Template) -> Template:
    """Return a template of what is computed from a field, or of what stands for it: see `meaning.stands_for`."""

    def raw(table: pa.RecordBatch) -> pa.Array:
        found = cells(MessagePart("", of, table, []), name)
        return pa.array([one if isinstance(one, int) else None for one in found], pa.int64())

    kind = columns.schema.field(columns.own(name)).type if name in columns else None
    if kind is not None and not pa.types.is_integer(kind):
        return value  # only whole numbers are special
    place = columns.place(columns.own(name)) if kind is not None else columns.computed(f"{name} raw", raw)
    if source.hex and (source.low is not None or source.high is not None):
        low = None if source.low is None else math.ceil(source.low)
        high = None if source.high is None else math.floor(source.high)
        digits: Template = ("number", PLAIN, ("format", "", "-", True, 2, None, "X"))
        value = ("range", place, low, high, value, ("all", [("text", "0x"), ("of", place, digits)]))
    cases = [(code, ("text", escape(text))) for code, text in source.special.items() if text]
    return ("by", place, cases, value) if cases else value


def name_template(of: Message | Packet, column: str) -> Template:
    """Return the template of a raw value of a column: its name, of a flag what it says, else the number in its unit."""
    about = meaning(of, column)
    if about.part is not None and about.part.flag:
        called = escape(about.part.called)
        return ("switch", PLAIN, [(0, ("text", f"no {called}"))], ("text", called))
    names = _raw_names(about)
    scale = next((one.scale for one in (about.note, about.part) if one is not None and one.scale is not None), None)
    scaled = None if scale is None else (float(scale.numerator), float(scale.denominator))
    number: Template = ("number", (None, None, scaled, False), ("plain",))
    if about.part.enum if about.part is not None else about.note is not None and about.note.enum:
        number = ("all", [("number", PLAIN, ("plain",)), ("text", " (undefined)")])
    unit = f" {about.unit}" if about.unit not in ("", UNSPECIFIED) else ""
    cases = [(raw, ("text", escape(text) + (unit if text != MISSING else ""))) for raw, text in names.items()]
    return ("switch", PLAIN, cases, ("all", [number, ("text", unit)]))


def _raw_names(about: Meaning) -> Mapping[int, str]:
    if about.note is not None:
        return {**about.note.enum, **about.note.special}
    return about.part.enum if about.part is not None else {}
