"""`--frame-list -T fields`: chosen fields of each frame, separated by tabs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.tables import ERROR, EXTENDED, REMOTE
from analyzer.views.fields import fixed
from analyzer.views.frames.cells import FrameSheet, FrameWriter, bit_of
from analyzer.views.frames.owners import OwnerFields
from analyzer.views.json_fields import HEX
from analyzer.views.members import NOTHING, PLAIN
from analyzer.views.terminal import escape
from analyzer.views.times import TimeFormat
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.decode.engine import Batch
    from analyzer.views.frames.rows import FrameRows, ListedFrames
    from analyzer.views.sheets import SheetColumns, Template
    from analyzer.window.listed import ListedRows
    from analyzer.window.numbering import Numbering
    from dissectors import Registry

_FLAGS = {"can.flags.xtd": EXTENDED, "can.flags.rtr": REMOTE, "can.flags.err": ERROR}
_NUMBERS = {"frame.number": "number", "can.id": "id", "can.len": "length"}
_TIMES = {"frame.time_epoch": "t", "frame.time_relative": "elapsed", "frame.time_delta": "delta"}
# Of an error frame there are none.
_OF_FRAMES = ("can.id", "can.flags.xtd")
FRAME_FIELDS = (
    "frame.number",
    "frame.time",
    "frame.interface_name",
    "frame.data",
    "can.id",
    "can.len",
    *_FLAGS,
    *_TIMES,
)


class FrameFields(FrameWriter):
    """Chosen fields of each frame, and of its transfer, separated by tabs.

    Raises `ValueError` for a name that does not exist.
    """

    def __init__(
        self, rows: FrameRows, names: tuple[str, ...], zero: int | None, registry: Registry, numbering: Numbering
    ) -> None:
        super().__init__(rows)
        self._names, self._zero = tuple(map(fixed, names)), zero
        self._dates = TimeFormat("ad", digits=9)
        owned = dict.fromkeys(name for name in self._names if name not in FRAME_FIELDS)
        self._owners = OwnerFields(registry, list(owned), numbering)
        self._sheet = FrameSheet(self._template)

    def rows(self, batch: Batch, picked: ListedRows) -> Iterator[str]:
        """Write each frame that is known for good."""
        self._owners.feed(batch)
        yield from super().rows(batch, picked)
        self._owners.forget(self._rows)

    def _texts(self, table: ListedFrames) -> Iterator[str]:
        times = table.rows.column("t")
        known, t = valid(times), numbers(times)
        if self._zero is None and known.any():
            self._zero = int(t[np.argmax(known)])
        missing = None if known.all() else ~known
        beside = {"elapsed": pa.array(t - (self._zero or 0), mask=missing), "delta": table.deltas()}
        if "frame.time" in self._names:
            beside["date"] = self._dates.dates(times)
        beside |= self._owners.columns(table.rows)
        return self._sheet.texts(table, beside, [[escape(name) for name in table.buses]])

    def _template(self, columns: SheetColumns) -> Template:
        tabs = [("text", "\t")] * len(self._names)
        cells = [self._cell(columns, name) for name in self._names]
        return ("all", [*[one for pair in zip(tabs, cells, strict=True) for one in pair][1:], ("text", "\n")])

    def _cell(self, columns: SheetColumns, name: str) -> Template:
        if name in self._owners.names:
            return columns.of(name, ("or", "", ("copy",)))
        if name == "frame.data":
            return columns.of("data", HEX)
        if name == "frame.time":
            return columns.of("date", ("or", "", ("copy",)))
        if name == "frame.interface_name":
            return columns.of("bus", ("word", 0))
        if name in _TIMES:
            return columns.of(_TIMES[name], ("number", PLAIN, ("seconds", False, True)))
        if name in _FLAGS:
            cell = columns.of("flags", ("number", bit_of(_FLAGS[name]), ("plain",)))
        else:
            cell = columns.of(_NUMBERS[name], ("number", PLAIN, ("plain",)))
        return ("by", columns.place("error"), [(1, NOTHING)], cell) if name in _OF_FRAMES else cell
