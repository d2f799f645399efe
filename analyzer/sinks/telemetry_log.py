"""Rows of `foxglove.Log`: what a log panel shows of the events of a capture."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pyarrow as pa

from analyzer.tables import EVENTS
from dissectors.kit.cells import numbers
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from analyzer.window.part import BatchPart
    from dissectors.kit import Array

INFO, WARNING, ERROR = 2, 3, 4
_LEVELS = {
    "error frame": ERROR, "drop": ERROR, "gap": WARNING, "unreadable": WARNING, "comment": INFO, "frame comment": INFO,
}  # fmt: skip


class LogRows(NamedTuple):
    """Messages as `rows` makes them, with their log times in ns; `findings` of them are about one each."""

    times: npt.NDArray[np.int64]
    messages: pa.RecordBatch
    findings: int


def rows(
    times: npt.NDArray[np.int64], known: npt.NDArray[np.bool_], levels: Sequence[int], texts: Sequence[str],
    names: Sequence[str | None], file: str,
) -> pa.RecordBatch:  # fmt: skip
    """Return messages with `times` in ns from 1970 on, none where it is not `known`.

    `line` stays away: records and frames are counted, not lines.
    """
    stamp = pa.StructArray.from_arrays(
        [pa.array(times // SECOND, pa.uint64()), pa.array(times % SECOND, pa.uint32())],
        names=["seconds", "nanos"], mask=pa.array(~known),
    )  # fmt: skip
    return pa.RecordBatch.from_pydict(
        {
            "timestamp": stamp,
            "level": pa.array(levels, pa.uint8()),
            "message": pa.array(texts, pa.string()),
            "name": pa.array(names, pa.string()),
            "file": pa.array([file] * len(texts), pa.string()),
        }
    )


def events(part: BatchPart, times: npt.NDArray[np.int64], buses: Sequence[str | None], file: str) -> pa.RecordBatch:
    """Return the events of a part, which stand at `times`; each is named by its bus."""
    table = part.events
    kinds = [EVENTS[kind] for kind in numbers(table.column("kind")).tolist()]
    lines = numbers(table.column("line")).tolist()
    counts = numbers(table.column("class")).tolist()
    said = [_said(*row) for row in zip(kinds, lines, table.column("text").to_pylist(), counts, strict=True)]
    known = ~np.asarray(table.column("t").is_null())
    return rows(times, known, [_LEVELS[kind] for kind in kinds], said, buses, file)


def stamps(column: pa.Array) -> Array:
    """Return nanoseconds from 1970 on; 0 where there is no time, or an earlier one."""
    return np.where(np.asarray(column.is_null()), 0, np.maximum(numbers(column), 0))


def _said(kind: str, line: int, text: str, count: int) -> str:
    number = f" of {count} frames" if kind == "drop" and count else ""
    return f"{kind}{number} (record {line})" + (f": {text}" if text else "")
