"""`-T jsonl`, `-T json` and `-T csv`: one record a transfer, for programs.

Every writer gives text with its line ends: `begin()`, then `rows(batch, picked)` for each batch, then `end()`.
"""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from analyzer.tables import KINDS, STATUSES
from analyzer.views.json_fields import (
    HEX,
    array_template,
    derived_templates,
    fields_template,
    member,
    number_template,
    object_template,
    quotes,
    text_of,
)  # fmt: skip
from analyzer.views.members import ALL, NOTHING, PLAIN
from analyzer.views.named import rules_of
from analyzer.views.pick import Pick
from analyzer.views.rows import TransferRows
from analyzer.views.sheets import Sheets, type_column, types_of
from dissectors.kit.cells import numbers, pylist
from dissectors.schema import Message

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.decode.engine import Batch
    from analyzer.rules.named_frames import NamedFrames
    from analyzer.views.sheets import SheetColumns, Template
    from analyzer.window.listed import ListedRows
    from dissectors import Registry
    from dissectors.schema import Packet

KEYS = (
    "frame", "frames", "t_ns", "bus", "kind", "type", "type_id", "src", "dst", "priority", "transfer_id", "status",
    "crc_wire", "crc_here", "payload", "fields", "packets",
)  # fmt: skip
DERIVED = ("derived", "units", "texts")
FINDINGS = "findings"
_OF_MESSAGES = ("fields", "packets", *DERIVED)  # keys that the message of a transfer has
_DECODED = (STATUSES.index("ok"), STATUSES.index("bad crc"))
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")
_WORDS = ("bus", "type")  # keys whose words are given with each batch
_CODES = {"kind": KINDS, "status": STATUSES}
_CRCS = ("crc_wire", "crc_here")
_CRC: Template = ("number", PLAIN, ("format", "", "-", True, 4, None, "X"))
_FROM_ONE: Template = ("number", PLAIN, ("from one",))
_BESIDE = {"type": pa.uint32(), "bare": pa.binary(), FINDINGS: pa.list_(pa.string())}


def _keys(named: NamedFrames | None, *, derived: bool) -> tuple[str, ...]:
    return (*KEYS, *(DERIVED if derived else ()), *(() if named is None else (FINDINGS,)))


class _Records:
    """Writes a record for each transfer, with the keys of `KEYS` in that order.

    `frames` are numbers from 1. What is absent is null: the time of a capture without times, the destination of a
    broadcast, the type of an unknown ID, the fields of a transfer that is broken. `packets` is null for types that
    carry none. With `derived` a record, and each packet, has the keys of `DERIVED`, too. With `named` there is a last
    key `findings`: the rules that name one of the frames.
    """

    def __init__(
        self, registry: Registry, named: NamedFrames | None, *, derived: bool, spread: bool = False, end: str = ""
    ) -> None:
        self._registry, self._named, self._derived = registry, named, derived
        self._word = csv_word if spread else text_of
        keys = _keys(named, derived=derived)

        def row(columns: SheetColumns) -> Template:
            cells = _Cells(columns, spread)
            parts = [cells.of(key) for key in keys]
            if spread:
                commas = [("text", ",")] * len(keys)
                made = [one for pair in zip(commas, parts, strict=True) for one in pair][1:]
                return ("all", [*made, ("text", end)])
            return ("all", [object_template(member(*pair) for pair in zip(keys, parts, strict=True)), ("text", end)])

        self._sheets = Sheets(registry, row, self._part, _BESIDE)

    def texts(self, batch: Batch, picked: ListedRows | None) -> Iterator[str]:
        """Yield the record of each picked transfer (all if not given)."""
        pick = Pick(batch, picked and picked.transfers)
        batch, rows = pick.batch, pick.rows
        types, places = type_column(batch, self._registry)
        beside = {"type": places, "bare": _bare(batch, self._registry)}
        if self._named is not None:
            rules = rules_of(self._named, pylist(batch.transfers.column("frame")))
            beside[FINDINGS] = pa.array(rules, _BESIDE[FINDINGS])
        names = [None if m is None else m.name for m in types]
        words = [[self._word(word) for word in some] for some in (batch.buses, names)]
        return self._sheets.texts(batch, rows, types_of(types, places, rows), beside, words)

    def _part(self, _: str, of: Message | Packet | None, columns: SheetColumns) -> list[Template | None]:
        if not isinstance(of, Message):
            return [self._packet(of, columns)]
        inside: Template = ("all", [("text", "["), ("packets", 0, ",", True), ("text", "]")])
        packets = None if of.packets is None else inside
        derived = derived_templates(of, columns, physical=False) if self._derived else dict.fromkeys(DERIVED)
        return [fields_template(of, columns, physical=False), packets, *derived.values()]

    def _packet(self, of: Packet | None, columns: SheetColumns) -> Template:
        sound = ("text", "false") if of is None else columns.of("packet_ok", number_template())
        parts = [member("type", ("text", text_of(None if of is None else of.name))), member("ok", sound)]
        parts.append(member("fields", fields_template(of, columns, physical=True)))
        if self._derived:
            derived = derived_templates(of, columns, physical=True)
            parts += [member(key, template) for key, template in derived.items()]
        if "decided" in columns:
            undecided = member("decided", ("text", "false"))
            parts.append(columns.of("decided", ("switch", PLAIN, [(1, NOTHING)], undecided)))
        return object_template(parts)


def _bare(batch: Batch, registry: Registry) -> pa.Array:
    """Return the payloads without their CAN FD padding."""
    if not numbers(batch.transfers.column("fd")).any():
        return batch.transfers.column("payload")
    return pa.array(TransferRows(batch, registry).unpadded(), pa.binary())


class _Cells:
    """Templates of the cells of a record: as values of JSON, or, `spread`, as cells of CSV."""

    def __init__(self, columns: SheetColumns, spread: bool) -> None:
        self._columns, self._spread, self._none = columns, spread, "" if spread else "null"

    def of(self, key: str) -> Template:
        """Return a template of what stands under a key."""
        column = {"t_ns": "t", "payload": "bare"}.get(key, "frame" if key == "frames" else key)
        if key in _OF_MESSAGES:
            inside = self._cell(("message", _OF_MESSAGES.index(key), self._none))
            return self._columns.of("status", ("switch", PLAIN, [(one, inside) for one in _DECODED], self._text(None)))
        return self._columns.of(column, self._value(key))

    def _value(self, key: str) -> Template:
        known: dict[str, Template] = {
            "frame": ("first", self._none, _FROM_ONE),
            "frames": self._list(_FROM_ONE),
            "payload": HEX if self._spread else quotes(HEX),
            FINDINGS: self._cell(self._list(("copy",) if self._spread else ("json",))),
        }
        if key in _WORDS:
            return ("word", _WORDS.index(key))
        if key in _CODES:
            return ("switch", PLAIN, [(code, self._text(name)) for code, name in enumerate(_CODES[key])], NOTHING)
        if key in _CRCS:
            return ("or", self._none, _CRC if self._spread else quotes(_CRC))
        return known.get(key, ("or", self._none, number_template()))

    def _text(self, text: str | None) -> Template:
        return ("text", (text or "") if self._spread else text_of(text))

    def _list(self, element: Template) -> Template:
        return ("each", " ", ALL, "", element) if self._spread else array_template(element)

    def _cell(self, template: Template) -> Template:
        return ("csv", template) if self._spread else template


class JsonLines:
    """One JSON object a line."""

    def __init__(self, registry: Registry, named: NamedFrames | None = None, *, derived: bool = False) -> None:
        self._records = _Records(registry, named, derived=derived, end="\n")

    def begin(self) -> str:
        """Write nothing: nothing stands before the first line."""
        return ""

    def rows(self, batch: Batch, picked: ListedRows | None = None) -> Iterator[str]:
        """Write a line for each picked transfer (all if not given)."""
        return self._records.texts(batch, picked)

    def end(self) -> str:
        """Write nothing: nothing stands behind the last line."""
        return ""


class JsonArray:
    """One JSON array over the whole capture, valid also when it is empty."""

    def __init__(self, registry: Registry, named: NamedFrames | None = None, *, derived: bool = False) -> None:
        self._records = _Records(registry, named, derived=derived)
        self._before = "\n"

    def begin(self) -> str:
        """Write the bracket that opens the array."""
        return "["

    def rows(self, batch: Batch, picked: ListedRows | None = None) -> Iterator[str]:
        """Write an element for each picked transfer (all if not given)."""
        for record in self._records.texts(batch, picked):
            yield self._before + record
            self._before = ",\n"

    def end(self) -> str:
        """Write the bracket that closes it."""
        return "\n]\n"


class Csv:
    """RFC 4180: one header, a line a transfer; `frames` are joined by blanks, what has parts of its own is JSON.

    Text that a spreadsheet would take for a formula gets an apostrophe in front.
    """

    def __init__(self, registry: Registry, named: NamedFrames | None = None, *, derived: bool = False) -> None:
        self._named, self._derived = named, derived
        self._records = _Records(registry, named, derived=derived, spread=True, end="\r\n")

    def begin(self) -> str:
        """Write the header."""
        return ",".join(_keys(self._named, derived=self._derived)) + "\r\n"

    def rows(self, batch: Batch, picked: ListedRows | None = None) -> Iterator[str]:
        """Write a line for each picked transfer (all if not given)."""
        return self._records.texts(batch, picked)

    def end(self) -> str:
        """Write nothing: nothing stands behind the last line."""
        return ""


def csv_word(word: str | None) -> str:
    """Return a text as a cell of a CSV file."""
    out = io.StringIO()
    csv.writer(out, lineterminator="").writerow([harmless(word), ""])
    return out.getvalue()[:-1]


def harmless(value: Any) -> Any:
    """Return a cell of a CSV file; a text that a spreadsheet would take for a formula gets an apostrophe in front."""
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value
