"""Captures that are done, and whose they are is told anew: vehicle and day decide nothing of what was found."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import pyarrow as pa

from analyzer.fleet.rows import day
from analyzer.fleet.tables import TABLES, plain

if TYPE_CHECKING:
    from collections.abc import Mapping


def renamed(rows: pa.Table, told: Mapping[str, tuple[str, str]]) -> pa.Table:
    """Return the newest rows of captures that are of another vehicle or day now, as rows that are newer still.

    `rows` are those of the table `captures`, `told` vehicle and day by key; without a day that of the first frame
    counts. Rows of other tables belong to them as before.
    """
    rows = rows.select(TABLES["captures"].names).sort_by("at_ns")
    newest = {key: place for place, key in enumerate(rows["key"].to_pylist()) if key in told}
    now: dict[int, tuple[str, str]] = {}
    for key, place in newest.items():
        vehicle, date = plain(told[key][0]), told[key][1]
        start = rows["start_ns"][place].as_py()
        names = vehicle, date or ("" if start is None else day(start))
        if names != (rows["vehicle"][place].as_py(), rows["date"][place].as_py()):
            now[place] = names
    picked = rows.take(pa.array(list(now), pa.int64()))
    columns = {
        "vehicle": [vehicle for vehicle, _ in now.values()],
        "date": [date for _, date in now.values()],
        "at_ns": [time.time_ns()] * len(now),
    }
    for name, values in columns.items():
        picked = picked.set_column(
            picked.schema.get_field_index(name), name, pa.array(values, picked.schema.field(name).type)
        )
    return picked
