"""Message tables come as one message of Arrow's IPC format: Arrow's own writer and reader agree with the core's."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pytest

import dissectors
from analyzer.decode.by_name import example
from analyzer.decode.engine import Engine

CAPTURES = Path(__file__).resolve().parents[2] / "captures"


def tables(capture: str) -> dict[str, pa.RecordBatch]:
    engine = Engine()
    list(engine.feed((CAPTURES / capture).read_bytes()))
    return dict(engine.finish().messages)


def check(table: pa.RecordBatch) -> None:
    table.validate(full=True)
    again = pa.RecordBatch.from_arrays(
        [pa.array(one.to_pylist(), one.type) for one in table.columns], table.schema.names
    )
    assert [one.null_count for one in table.columns] == [one.null_count for one in again.columns]
    assert table.equals(again)
    buffers = [buffer for one in table.columns for buffer in one.buffers() if buffer is not None and buffer.size]
    assert all(buffer.address % 8 == 0 for buffer in buffers)


@pytest.mark.parametrize("capture", ["mission-8-faults.log", "hobbywing.log"])
def test_tables_are_what_arrow_would_make_of_their_values(capture: str) -> None:
    found = tables(capture)
    assert len(found) > 5
    for table in found.values():
        check(table)


def test_cells_without_a_value_are_counted() -> None:
    counts = [one.null_count for table in tables("mission-8-faults.log").values() for one in table.columns]
    assert any(counts)
    assert not all(counts)


def test_every_type_has_such_a_table() -> None:
    registry = dissectors.load()
    for message in map(registry.resolve, registry.names()):
        for table in example(registry, message).values():
            check(table)


def test_it_lies_where_the_core_has_put_it() -> None:
    table = tables("mission-8-faults.log")["RawCommand"]
    starts = [buffer.address for one in table.columns for buffer in one.buffers() if buffer is not None]
    assert starts == sorted(starts)
    assert starts[-1] - starts[0] < table.nbytes + 16 * len(starts)
