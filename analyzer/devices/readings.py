"""Which rows of a table read a doubtful field as a picture of a device wants it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.decode.told import reading_column
from dissectors.kit.cells import holds_text

if TYPE_CHECKING:
    import pyarrow as pa

    from dissectors.kit import Array
    from dissectors.only import Only


def holding(only: Only | None, table: pa.RecordBatch) -> Array | None:
    """Return the rows whose node reads its field so; None for all of them."""
    if only is None:
        return None
    name = reading_column(only.reading)
    if name not in table.schema.names:
        return np.zeros(len(table), bool)
    rows = holds_text(table.column(name), only.choice)
    return None if rows.all() else rows
