"""`-x`: the bytes of a transfer, frame by frame, with what each of them is for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.tables import EXTENDED, FD, TAIL_END, TAIL_ID, TAIL_START, TAIL_TOGGLE
from analyzer.views.members import ALL, NOTHING
from analyzer.views.members import PLAIN as AS_IT_IS
from analyzer.views.pick import Pick
from analyzer.views.rows import TransferRows
from analyzer.views.sheets import Sheets
from analyzer.views.terminal import PLAIN, Palette
from analyzer.window.numbering import Numbering
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.decode.engine import Batch
    from analyzer.views.frames.window import FrameWindow
    from analyzer.views.sheets import SheetColumns, Template
    from dissectors import Registry
    from dissectors.kit import Array

PER_LINE = 16
_CRC_BYTES = 2
_INDENT = " " * 4
_ROLES = {"crc": "crc ", "payload": "", "padding": "padding ", "tail": "tail "}  # of bytes, in order, and their labels
# Columns about a frame: how many of its bytes have which role, too, and its tail byte.
_FRAME = ("number", "id", "extended", "fd", "data", *_ROLES, "tail byte")
_BESIDE = {"frames": pa.list_(pa.null())}


def tail_words(tail: int) -> str:
    """Return a tail byte, decoded (4.1.3)."""
    ends = [word for bit, word in ((TAIL_START, "start"), (TAIL_END, "end")) if tail & bit]
    return " ".join([*ends, f"toggle {int(tail & TAIL_TOGGLE != 0)}", f"ID {tail & TAIL_ID}"])


class HexDumps:
    """Writes the bytes of transfers.

    Args:
        registry: the types that the batches were decoded with.
        frames: keeps the frames; it has to be fed first.
        palette: colours; without them the roles are told by labels alone.
        numbering: of the frames; those of the capture if not given.
    """

    def __init__(
        self, registry: Registry, frames: FrameWindow, palette: Palette = PLAIN, numbering: Numbering | None = None
    ) -> None:
        self._registry, self._frames, self._palette = registry, frames, palette
        self._numbering = numbering or Numbering()
        self._sheets = Sheets(registry, self._row, lambda *_: [], _BESIDE)

    def texts(self, batch: Batch, picked: Array) -> Iterator[str]:
        """Yield the lines about the frames of each picked transfer."""
        pick = Pick(batch, picked)
        if not len(pick):
            return iter(())
        batch = pick.batch
        frames = batch.transfers.column("frame")
        ends = np.asarray(frames.offsets)
        places = numbers(frames.values)[ends[0] : ends[-1]].astype(np.int64)
        found, ends = self._frames.rows(places), ends - ends[0]
        size, tail = _sizes_and_ends(found["data"])
        flags = numbers(found["flags"])
        columns = {
            "number": self._numbering.of_all(places), "extended": flags & EXTENDED != 0, "fd": flags & FD != 0,
            **_roles(size, tail, ends, _padding(batch, self._registry)),
        }  # fmt: skip
        made = found | {name: pa.array(column) for name, column in columns.items()}
        made["tail byte"] = pa.array(tail, mask=size == 0)
        rows = pa.StructArray.from_arrays([made[name] for name in _FRAME], _FRAME)
        lists = pa.ListArray.from_arrays(pa.array(ends, pa.int32()), rows)
        return self._sheets.texts(batch, pick.rows, [], {"frames": lists}, [])

    def _row(self, columns: SheetColumns) -> Template:
        """Return the template of the lines about the frames of a transfer."""
        digits = [_of("id", ("number", AS_IT_IS, ("format", "", "-", True, count, None, "X"))) for count in (8, 3)]
        words = [(tail, ("text", f"  {tail_words(tail)}")) for tail in range(256)]
        pieces = [(_FRAME.index(role), label, *self._palette.around(role)) for role, label in _ROLES.items()]
        shown: Template = ("all", [
            ("text", "  "), ("by", _FRAME.index("extended"), [(1, digits[0])], digits[1]),
            _of("fd", ("switch", AS_IT_IS, [(1, ("text", " FD"))], NOTHING)), ("text", "  "),
            ("dump", _FRAME.index("data"), " | ", PER_LINE, pieces),
            _of("tail byte", ("switch", AS_IT_IS, words, ("text", "no data"))),
        ])  # fmt: skip
        number = _of("number", ("number", AS_IT_IS, ("plain",)))
        line = ("given", _FRAME.index("id"), shown, ("text", ": its bytes are no longer kept"))
        return columns.of(
            "frames",
            ("each", "", ALL, "", ("all", [("text", f"{_INDENT}frame "), number, line, ("text", "\n")])),
        )


def _of(name: str, template: Template) -> Template:
    return ("of", _FRAME.index(name), template)


def _sizes_and_ends(data: pa.Array) -> tuple[Array, Array]:
    """Return how many bytes each cell has, and the last of them, 0 for none."""
    _, ends, letters = data.buffers()
    ends = np.frombuffer(ends, np.int32, len(data) + 1, data.offset * 4)
    size = np.where(valid(data), np.diff(ends), 0)
    if letters is None or not size.any():
        return size, np.zeros(len(size), np.uint8)
    return size, np.where(size > 0, np.frombuffer(letters, np.uint8)[np.maximum(ends[1:] - 1, 0)], 0).astype(np.uint8)


def _roles(size: Array, tail: Array, ends: Array, padding: Array) -> dict[str, Array]:
    """Return for each frame how many of its bytes have which role.

    Args:
        size: the bytes of each frame.
        tail: its last byte.
        ends: where the frames of each transfer begin and end.
        padding: bytes at the end of the last frame of each transfer that only fill up a CAN FD frame.
    """
    count, whole = np.diff(ends), TAIL_START | TAIL_END
    odd = np.concatenate(([0], np.cumsum((size > 0) & (tail & whole != whole))))
    several = np.repeat((count > 1) | (odd[ends[1:]] > odd[ends[:-1]]), count)
    fill = np.zeros(len(size), np.int64)
    fill[ends[1:][count > 0] - 1] = padding[count > 0]
    body = np.maximum(size - 1, 0)
    crc = np.where(several & (tail & TAIL_START != 0), np.minimum(body, _CRC_BYTES), 0)
    fill = np.minimum(fill, body - crc)
    return {"crc": crc, "payload": body - crc - fill, "padding": fill, "tail": np.minimum(size, 1)}


def _padding(batch: Batch, registry: Registry) -> Array:
    if not numbers(batch.transfers.column("fd")).any():
        return np.zeros(len(batch.transfers), np.int64)
    return np.array(TransferRows(batch, registry).padding(), np.int64)
