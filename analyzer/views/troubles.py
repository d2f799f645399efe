"""Words for what went wrong with transfers: how far broken ones came, and what is odd about others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.tables import STATUSES, TRANSFER_ANOMALIES
from analyzer.views.wording import anomalies
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.decode.engine import Batch
    from dissectors.kit import Array
    from dissectors.schema import Message

_OK, _UNCHECKED, _BAD_CRC, _, _TIMED_OUT, _TOO_SHORT, _OPEN = range(len(STATUSES))
_TOGGLE = 1 << TRANSFER_ANOMALIES.index("toggle")


class _Words:
    """Texts of some rows of a batch, each kept once, as a column of places in a list."""

    def __init__(self, rows: int) -> None:
        self._places: dict[str, int] = {"": 0}
        self._column = np.zeros(rows, np.uint32)

    def put(self, row: int, text: str) -> None:
        """Say something of a row."""
        self._column[row] = self._places.setdefault(text, len(self._places))

    def taken(self) -> tuple[pa.Array, list[str]]:
        """Return the column and the list; a row of which nothing is said has an empty text."""
        return pa.array(self._column), list(self._places)


def troubles(
    batch: Batch, types: Sequence[Message | None], places: Array, rows: Array
) -> tuple[pa.Array, list[str]]:  # fmt: skip
    """Return how far each broken transfer among some rows came, as places in a list of texts.

    `types` are those of the batch, `places` gives each row's.
    """
    transfers = batch.transfers
    status, odd, fd = (numbers(transfers.column(name)) for name in ("status", "anomaly", "fd"))
    words = _Words(len(transfers))
    found = rows[status[rows] > _BAD_CRC]
    ends = [_ends(transfers.column(name)) for name in ("frame", "payload")]
    frames, sizes = ((some[found + 1] - some[found]).tolist() for some in ends)
    columns = (column[found].tolist() for column in (status, fd, odd & _TOGGLE != 0, places))
    told = zip(found.tolist(), frames, sizes, *columns, strict=True)
    for row, count, size, code, long, gap, place in told:
        words.put(row, broken_words(code, count, size, None if long else types[place], gap=gap))
    return words.taken()


def oddities(
    batch: Batch, rows: Array, bits: int, say: Callable[[Sequence[str]], str]
) -> tuple[pa.Array, list[str]]:  # fmt: skip
    """Return what is odd about transfers among some rows, as places in a list of texts that `say` makes of words.

    Of the anomalies of a transfer those among `bits` are told.
    """
    transfers = batch.transfers
    odd = numbers(transfers.column("anomaly")).astype(np.int64) & bits
    words, found = _Words(len(transfers)), rows[odd[rows] != 0]
    step = transfers.column("step")
    columns = odd, numbers(step), valid(step)
    for row, code, by, known in zip(found.tolist(), *(column[found].tolist() for column in columns), strict=True):
        words.put(row, say(anomalies(code, by if known else None)))
    return words.taken()


def _ends(array: pa.Array) -> Array:
    return np.frombuffer(array.buffers()[1], np.int32, len(array) + 1, array.offset * 4)


def broken_words(status: int, frames: int, size: int, message: Message | None, *, gap: bool) -> str:
    """Say how far a broken transfer came, of how many frames if its type has one length; `gap`: some are missing."""
    total = _frames_of(message)
    if total is not None and frames < total:
        progress = f"{frames} of {total} frames"
    else:
        progress = f"{frames} frame{'s' * (frames != 1)}, {size} byte{'s' * (size != 1)}"
    if status == _TIMED_OUT:
        return f"timed out after {progress}"
    if status == _OPEN:
        return f"capture ends after {progress}"
    if status == _TOO_SHORT:
        return f"too short for a CRC: {progress}"
    return f"broken, {progress}" if gap else f"cut after {progress}"


def _frames_of(message: Message | None) -> int | None:
    """Return the frames of a classic CAN transfer, if the type has one length."""
    if message is None or message.min_bytes != message.max_bytes:
        return None
    return 1 if message.max_bytes <= 7 else -(-(message.max_bytes + 2) // 7)
