"""Lines about messages and packets: templates of the summaries that profiles give, and of what is remarked."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.devices.remarks import Remarks
from analyzer.facts.meaning import meaning
from analyzer.views.members import NOTHING, PLAIN, CellTemplates, part_of
from analyzer.views.sheets import tables_of
from analyzer.views.terminal import display_width, escape, fit
from analyzer.views.values import members, name_template, named, value_template
from analyzer.views.wording import MISSING
from dissectors import template
from dissectors.kit.cells import numbers
from dissectors.schema import Message

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from analyzer.decode.engine import Batch
    from analyzer.devices.remarks import Remarked
    from analyzer.views.members import Take
    from analyzer.views.sheets import SheetColumns, Template
    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.schema import Packet, Remark

# Bounds of a line about a type without a template, and of bytes shown in a line.
FIELDS_SHOWN = 12
ITEMS_SHOWN = 20
BYTES_SHOWN = 64
_LEAST_SUMMARY = 10
REMARK = "\x1f"  # in front of what is remarked: texts have no control characters
OCTETS: Template = ("hex", " ", BYTES_SHOWN, "no data", " ... ", " bytes")

_slots = lru_cache(maxsize=1024)(template.parse)


class Phrases:
    """Gives the templates of lines about messages and packets; `feed` takes each batch before it is rendered.

    Args:
        registry: the types.
        between: what stands between the summary and what is remarked.
    """

    def __init__(self, registry: Registry, between: str) -> None:
        self._registry, self._between = registry, between
        self._remarks = Remarks()
        self._found: dict[str, list[Remarked]] = {}

    def feed(self, batch: Batch, messages: Iterable[Message], picked: Array) -> None:
        """Look for what is to be remarked of the picked transfers of a batch."""
        shown = np.zeros(len(batch.transfers), bool)
        shown[picked] = True
        some = None if shown.all() else shown
        self._found = {
            name: self._remarked(batch, name, of, table, some)
            for message in messages
            for name, of, table in tables_of(batch, message, self._registry)
            if of is not None and any(remark.column for remark in of.remarks)
        }

    def part(self, name: str, of: Message | Packet | None, columns: SheetColumns) -> list[Template | None]:
        """Return the template of the line about a row of a table; of a message with what it carries."""
        if of is None:
            return [("all", [columns.of("reason", ("copy",)), ("text", ": "), columns.of("data", OCTETS)])]
        line = self._line(name, of, columns)
        if isinstance(of, Message):
            return [("all", [("joined", " | ", [("packets", 0, " | ", False), line]), _missing(columns)])]
        damaged = ("switch", PLAIN, [(1, NOTHING)], ("text", " (packet damaged)"))
        return [("all", [("text", f"{of.name} "), line, columns.of("packet_ok", damaged)])]

    def _line(self, name: str, of: Message | Packet, columns: SheetColumns) -> Template:
        line = _summary(of, columns) if of.summary else _all_fields(of, columns)
        if not of.remarks:
            return line
        causes = [remark for remark in of.remarks if remark.column]
        said = [self._remark(name, of, columns, place) for place in range(len(causes))]
        otherwise = ", ".join(escape(remark.text) for remark in of.remarks if not remark.column)
        return ("joined", self._between, [line, ("instead", ("text", otherwise), ("joined", ", ", said))])

    def _remark(self, name: str, of: Message | Packet, columns: SheetColumns, place: int) -> Template:
        """Return the template of a remark: nothing in rows that give no cause for it."""
        remark = [remark for remark in of.remarks if remark.column][place]
        raw = columns.computed(f"remark {place}", partial(self._column, name, place, False))
        said = _said(of, columns, remark, raw)
        if remark.changes:
            before = columns.computed(f"before {place}", partial(self._column, name, place, True))
            was: Template = ("all", [name_template(of, remark.column), ("text", " -> ")])
            said = ("all", [("of", before, ("or", "", was)), said])
        return ("given", raw, said, NOTHING)

    def _remarked(
        self, batch: Batch, name: str, of: Message | Packet, table: pa.RecordBatch, shown: Array | None
    ) -> list[Remarked]:
        """Return for each remark of a table its rows, their raw values, and the values before."""
        rows = np.arange(len(table))
        if shown is not None:
            rows = np.flatnonzero(shown[numbers(table.column("transfer")).astype(np.int64) - batch.first_transfer])
            table = table.take(pa.array(rows))
        found: list[Remarked] = self._remarks.feed([(name, of, table)])[name] if len(rows) else []
        return [one._replace(rows=rows[one.rows]) for one in found]

    def _column(self, name: str, place: int, before: bool, table: pa.RecordBatch) -> pa.Array:
        """Return raw values of a remark's rows, or those before, as a column of the table."""
        remarks = self._found.get(name)
        if not remarks or not len(remarks[place].rows):
            return pa.nulls(len(table), pa.int64())
        rows, found = remarks[place].rows, remarks[place].before if before else remarks[place].raw
        cells, none = np.zeros(len(table), np.int64), np.ones(len(table), bool)
        cells[rows], none[rows] = found, found < 0 if before else False
        return pa.array(cells, mask=none)


def _summary(of: Message | Packet, columns: SheetColumns) -> Template:
    pieces: list[Template] = []
    for slot in _slots(of.summary):
        pieces += [("text", escape(slot.text))] if slot.text else []
        pieces += [value_template(of, columns, slot.column, slot.format)] if slot.column else []
    return ("all", pieces)


def _said(of: Message | Packet, columns: SheetColumns, remark: Remark, raw: int) -> Template:
    note = of.notes.get(remark.column)
    flags = [bits for bits in note.parts if bits.flag] if note is not None and not remark.text else []
    if flags:
        one = [("switch", part_of(bits), [(1, ("text", escape(bits.called)))], NOTHING) for bits in flags]
        return ("of", raw, ("joined", ", ", one))
    pieces: list[Template] = []
    for slot in _slots(remark.text or f"{{{remark.column}}}"):
        pieces.append(("text", escape(slot.text)))
        if slot.column == remark.column and not slot.format:
            pieces.append(("of", raw, name_template(of, slot.column)))
        elif slot.column:
            pieces.append(value_template(of, columns, slot.column, slot.format))
    said: Template = ("all", pieces)
    return ("by", raw, [(code, ("upper", said)) for code in remark.capitals], said) if remark.capitals else said


def _missing(columns: SheetColumns) -> Template:
    """Return the template of how many bytes a message lacks."""

    def lacking(table: pa.RecordBatch) -> pa.Array:
        return pa.array(np.maximum(-(numbers(table.column("bits_left")).astype(np.int64) // 8), 0))

    some: Template = ("all", [("text", " ("), ("number", PLAIN, ("plain",)), ("text", " bytes missing)")])
    cases = [(0, NOTHING), (1, ("text", " (1 byte missing)"))]
    return ("of", columns.computed("bytes missing", lacking), ("switch", PLAIN, cases, some))


def _all_fields(of: Message | Packet, columns: SheetColumns) -> Template:
    fields: list[Template] = []
    for member in [m for m in of.layout.fields if m.name][:FIELDS_SHOWN]:
        cell = _bounded(meaning(of, member.name).texts).column(of, columns, member.name)
        fields.append(("all", [("text", f"{member.name} "), cell]))
    return ("joined", ", ", fields)


def _bounded(texts: Mapping[float, str]) -> CellTemplates:
    """Return how cells are written of which nobody said how: not more of a list than fits a line."""

    def single(kind: pa.DataType, take: Take) -> Template:
        if pa.types.is_struct(kind):
            inner: Template = ("joined", ", ", members(kind, _bounded({}).cell))
            return ("all", [("text", "{"), inner, ("text", "}")])
        return named(texts, ("number", take, ("plain",)), take)

    def each(element: Template) -> Template:
        items: Template = ("each", " ", ITEMS_SHOWN, " ... ", element)
        return ("chars", BYTES_SHOWN, ("all", [("text", "["), items, ("text", "]")]))

    return CellTemplates(MISSING, single, each)


def shortened(info: str, width: int) -> str:
    """Return a line in at most `width` columns; what is remarked is cut only after most of what stands before it."""
    whole = info.replace(REMARK, " ")
    summary, mark, _ = info.partition(REMARK)
    if not mark or display_width(whole) <= width:
        return fit(whole, width)
    rest = whole[len(summary) + 1 :]
    start = fit(summary, max(_LEAST_SUMMARY, width - 1 - display_width(rest)))
    return fit(f"{start} {rest}", width)
