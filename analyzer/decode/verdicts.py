"""Last words on frames that are in a table already."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from dissectors.kit import Array


def with_verdicts(frames: pa.RecordBatch, rows: Array, verdict: Array, anomaly: Array) -> pa.RecordBatch:
    """Return a table of frames of which some rows have another verdict, and more anomalies.

    A row may be named several times: then the last verdict holds, and anomalies add up.
    """
    verdicts, anomalies = (numbers(frames.column(name)).copy() for name in ("verdict", "anomaly"))
    verdicts[rows] = verdict
    np.bitwise_or.at(anomalies, rows, anomaly)
    for name, values in (("verdict", verdicts), ("anomaly", anomalies)):
        k = frames.schema.get_field_index(name)
        frames = frames.set_column(k, frames.schema.field(k), pa.array(values))
    return frames
