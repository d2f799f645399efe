"""Statistics for programs: JSON, CSV, and Arrow tables."""

from __future__ import annotations

import csv
import io
import json
from math import isfinite
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from analyzer.stats.table import FOR_PEOPLE
from analyzer.views.records import harmless
from analyzer.views.terminal import escape

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analyzer.stats.table import StatTable

_WHOLE = pa.int64()
_ARROW = {"text": pa.string(), "count": _WHOLE, "number": pa.float64(), "time": pa.timestamp("ns"), "span": _WHOLE}
_ARROW["since"] = _ARROW["number"]


def render_json(head: Mapping[str, Any], tables: Sequence[StatTable]) -> str:
    """Write one JSON object: what stands above the tables, and each table by its name; of two with one name a list."""
    found: dict[str, Any] = {}
    for table in tables:
        rows = [_plain(row) for row in table.records()]
        content: dict[str, Any] = {"about": table.about, "rows": rows, "notes": list(table.notes)}
        if table.total is not None:
            names = [column.name for column in table.columns]
            content["total"] = _plain({n: v for n, v in zip(names, table.total, strict=True) if v is not None})
        if table.name in found:
            before = found[table.name]
            found[table.name] = [*(before if isinstance(before, list) else [before]), content]
        else:
            found[table.name] = content
    return json.dumps({**head, "statistics": found}, indent=2, allow_nan=False) + "\n"


def render_csv(tables: Sequence[StatTable]) -> Iterator[str]:
    """Yield the tables as CSV; several of them are apart by an empty line, and each begins with its name."""
    for number, table in enumerate(tables):
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        if len(tables) > 1:
            out.write("\n" * (number > 0))
            writer.writerow([f"# {table.name}"])
        writer.writerow(table.names)
        writer.writerows([_cell(cell) for cell in row] for row in table.plain)
        yield out.getvalue()


def _cell(value: Any) -> Any:
    """Return a cell that may be shown on a terminal, and opened in a spreadsheet."""
    return "" if value is None else harmless(escape(value)) if isinstance(value, str) else value


def arrow(table: StatTable) -> pa.Table:
    """Return a table as Arrow, what it says of itself as metadata."""
    fields = [pa.field(column.name, _ARROW[column.kind]) for column in table.columns if column.kind not in FOR_PEOPLE]
    about = {"name": table.name, "about": table.about, "notes": "\n".join(table.notes)}
    schema = pa.schema(fields, metadata=about)
    columns = list(zip(*table.plain, strict=True)) if table.rows else [()] * len(fields)
    arrays = [pa.array(values, field.type) for values, field in zip(columns, fields, strict=True)]
    return pa.Table.from_arrays(arrays, schema=schema)


def _plain(record: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _finite(value) for name, value in record.items()}


def _finite(value: Any) -> Any:
    return str(value) if isinstance(value, float) and not isfinite(value) else value
