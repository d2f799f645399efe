"""`-T jsonl`, `-T json` and `-T csv`: one record a transfer, for programs.

Every writer gives text with its line ends: `begin()`, then `rows(batch, picked)` for each batch, then `end()`.
"""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING, Any

from analyzer.tables import KINDS, STATUSES
from analyzer.views.jsonable import derived_objects, field_objects
from analyzer.views.named import rules_of
from analyzer.views.rows import TransferRows
from dissectors.kit.cells import pylist

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.decode.engine import Batch
    from analyzer.rules.named_frames import NamedFrames
    from analyzer.window.listed import ListedRows
    from dissectors import Registry
    from dissectors.kit import Array

KEYS = (
    "frame", "frames", "t_ns", "bus", "kind", "type", "type_id", "src", "dst", "priority", "transfer_id", "status",
    "crc_wire", "crc_here", "payload", "fields", "packets",
)  # fmt: skip
DERIVED = ("derived", "units", "texts")
FINDINGS = "findings"
_DECODED = (STATUSES.index("ok"), STATUSES.index("bad crc"))
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")


def records(
    batch: Batch,
    registry: Registry,
    picked: Array | None = None,
    named: NamedFrames | None = None,
    *,
    derived: bool = False,
) -> Iterator[dict[str, Any]]:
    """Give a record for each picked transfer (all if not given), with the keys of `KEYS` in that order.

    `frames` are numbers from 1. What is absent is None: the time of a capture without times, the destination of a
    broadcast, the type of an unknown ID, the fields of a transfer that is broken. `packets` is None for types that
    carry none. With `derived` a record, and each packet, has the keys of `DERIVED`, too. With `named` there is a last
    key `findings`: the rules that name one of the frames.
    """
    rows = TransferRows(batch, registry, picked)
    fields, packets = _fields(rows), _packets(rows, derived=derived)
    numbers = [[frame + 1 for frame in frames] for frames in rows.column("frame")]
    columns = {
        "frame": [frames[0] if frames else None for frames in numbers],
        "frames": numbers,
        "t_ns": rows.column("t"),
        "bus": [batch.buses[bus] for bus in rows.column("bus")],
        "kind": [KINDS[kind] for kind in rows.column("kind")],
        "type": [None if m is None else m.name for m in rows.messages],
        **{name: rows.column(name) for name in ("type_id", "src", "dst", "priority", "transfer_id")},
        "status": [STATUSES[status] for status in rows.column("status")],
        **{name: [None if v is None else f"{v:04X}" for v in rows.column(name)] for name in ("crc_wire", "crc_here")},
        "payload": [p.hex().upper() for p in rows.unpadded()],
        "fields": fields,
        "packets": packets,
    }
    keys = _keys(named, derived=derived)
    if derived:
        columns |= _derived(rows)
    if named is not None:
        columns[FINDINGS] = rules_of(named, rows.column("frame"))
    for values in zip(*(columns[key] for key in keys), strict=True):
        yield dict(zip(keys, values, strict=True))


def _keys(named: NamedFrames | None, *, derived: bool) -> tuple[str, ...]:
    return (*KEYS, *(DERIVED if derived else ()), *(() if named is None else (FINDINGS,)))


def _derived(rows: TransferRows) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {key: [None] * len(rows) for key in DERIVED}
    status = rows.column("status")
    for part in rows.typed:
        for at, values in zip(part.at, derived_objects(part, physical=False), strict=True):
            for key in DERIVED:
                found[key][at] = values[key] if status[at] in _DECODED else None
    return found


def _fields(rows: TransferRows) -> list[dict[str, Any] | None]:
    found: list[dict[str, Any] | None] = [None] * len(rows)
    status = rows.column("status")
    for part in rows.typed:
        for at, values in zip(part.at, field_objects(part, physical=False), strict=True):
            found[at] = values if status[at] in _DECODED else None
    return found


def _packets(rows: TransferRows, *, derived: bool) -> list[list[dict[str, Any]] | None]:
    found: list[list[dict[str, Any]] | None] = [None] * len(rows)
    status = rows.column("status")
    for part in rows.typed:
        if getattr(part.of, "packets", None) is not None:
            for at in part.at:
                found[at] = [] if status[at] in _DECODED else None
    objects = {}
    for part in rows.packets:
        name = None if part.of is None else part.of.name
        sound = [False] * len(part.table) if part.of is None else pylist(part.table.column("packet_ok"))
        fields = field_objects(part, physical=True)
        more = derived_objects(part, physical=True) if derived else [{}] * len(part.table)
        three = zip(sound, fields, more, strict=True)
        made = [{"type": name, "ok": ok, "fields": f, **beside} for ok, f, beside in three]
        if "decided" in part.table.schema.names:
            decided = pylist(part.table.column("decided"))
            made = [one if known else one | {"decided": False} for one, known in zip(made, decided, strict=True)]
        objects[id(part)] = made
    for at, packets in rows.inner().items():
        if found[at] is not None:
            found[at] = [objects[id(part)][row] for _, part, row in packets]
    return found


class JsonLines:
    """One JSON object a line."""

    def __init__(self, registry: Registry, named: NamedFrames | None = None, *, derived: bool = False) -> None:
        self._registry, self._named, self._derived = registry, named, derived

    def begin(self) -> str:
        """Write nothing: nothing stands before the first line."""
        return ""

    def rows(self, batch: Batch, picked: ListedRows | None = None) -> Iterator[str]:
        """Write a line for each picked transfer (all if not given)."""
        for record in records(batch, self._registry, picked and picked.transfers, self._named, derived=self._derived):
            yield text_of(record) + "\n"

    def end(self) -> str:
        """Write nothing: nothing stands behind the last line."""
        return ""


class JsonArray:
    """One JSON array over the whole capture, valid also when it is empty."""

    def __init__(self, registry: Registry, named: NamedFrames | None = None, *, derived: bool = False) -> None:
        self._registry, self._named, self._derived = registry, named, derived
        self._before = "\n"

    def begin(self) -> str:
        """Write the bracket that opens the array."""
        return "["

    def rows(self, batch: Batch, picked: ListedRows | None = None) -> Iterator[str]:
        """Write an element for each picked transfer (all if not given)."""
        for record in records(batch, self._registry, picked and picked.transfers, self._named, derived=self._derived):
            yield self._before + text_of(record)
            self._before = ",\n"

    def end(self) -> str:
        """Write the bracket that closes it."""
        return "\n]\n"


class Csv:
    """RFC 4180: one header, a line a transfer; `frames` are joined by blanks, what has parts of its own is JSON.

    Text that a spreadsheet would take for a formula gets an apostrophe in front.
    """

    def __init__(self, registry: Registry, named: NamedFrames | None = None, *, derived: bool = False) -> None:
        self._registry, self._named, self._derived = registry, named, derived

    def begin(self) -> str:
        """Write the header."""
        return ",".join(_keys(self._named, derived=self._derived)) + "\r\n"

    def rows(self, batch: Batch, picked: ListedRows | None = None) -> Iterator[str]:
        """Write a line for each picked transfer (all if not given)."""
        out = io.StringIO()
        writer = csv.writer(out)
        for record in records(batch, self._registry, picked and picked.transfers, self._named, derived=self._derived):
            record["frames"] = " ".join(map(str, record["frames"]))
            if FINDINGS in record:
                record[FINDINGS] = " ".join(record[FINDINGS])
            for key in ("fields", "packets", *(DERIVED if self._derived else ())):
                record[key] = None if record[key] is None else text_of(record[key])
            writer.writerow([harmless(value) for value in record.values()])
            yield out.getvalue()
            out.seek(0)
            out.truncate()

    def end(self) -> str:
        """Write nothing: nothing stands behind the last line."""
        return ""


def text_of(value: Any) -> str:
    """Write JSON in ASCII: control characters and changes of writing direction are escapes."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def harmless(value: Any) -> Any:
    """Return a cell of a CSV file; a text that a spreadsheet would take for a formula gets an apostrophe in front."""
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value
