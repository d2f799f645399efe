"""Captures that are done count again: with other settings they were newer, or whose they are is told anew."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import pyarrow as pa

from analyzer.fleet.rows import day
from analyzer.fleet.tables import TABLES, plain

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping


def renewed(rows: pa.Table, done: Collection[str], told: Mapping[str, tuple[str, str]]) -> tuple[pa.Table, int]:
    """Return the rows of captures that are to be written anew, newer than all others, and how many change their names.

    `rows` are those of the table `captures`, `done` the keys that are to count, `told` vehicle and day by key where
    they are told at all; without a day that of the first frame counts. What is not told stays as it was told last.
    Rows of other tables belong to them as before.
    """
    rows = rows.select(TABLES["captures"].names).sort_by("at_ns")
    columns = [rows[name].to_pylist() for name in ("key", "url", "vehicle", "date", "start_ns")]
    places, newest, last = {}, {}, {}
    for place, (key, url, vehicle, date, _) in enumerate(zip(*columns, strict=True)):
        places[key], newest[url], last[url] = place, key, (vehicle, date)
    now: dict[int, tuple[str, str]] = {}
    changed = 0
    for key in done:
        place = places[key]
        url, start = columns[1][place], columns[4][place]
        names = last[url]
        if key in told:
            vehicle, date = told[key]
            names = plain(vehicle), date or ("" if start is None else day(start))
        changed += names != last[url]
        if names != last[url] or newest[url] != key:
            now[place] = names
    picked = rows.take(pa.array(list(now), pa.int64()))
    anew = {
        "vehicle": [vehicle for vehicle, _ in now.values()],
        "date": [date for _, date in now.values()],
        "at_ns": [time.time_ns()] * len(now),
    }
    for name, values in anew.items():
        column = pa.array(values, picked.schema.field(name).type)
        picked = picked.set_column(picked.schema.get_field_index(name), name, column)
    return picked, changed
