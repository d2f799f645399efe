"""Laws of statistics: every table adds up to the account of the capture, and any cut of the text gives the same."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import ROOT, VECTORS
from kit.strategies import Capture, captures, examples

import analyzer
from analyzer.tables import VERDICTS

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.stats.table import StatTable

ALL = ["io,0.1", "hierarchy", "talkers", "services", "periods", "load", "nodes", "values,ESCStatus.voltage"]
FILES = ["captures/faults.log", "captures/services.log", "captures/fd.log", "captures/reordering.log"]


def column(table: StatTable, name: str) -> list[Any]:
    return [row[name] for row in table.records()]


def total(table: StatTable, name: str) -> Any:
    assert table.total is not None
    return dict(zip([one.name for one in table.columns], table.total, strict=True))[name]


def leaves(table: StatTable) -> list[Any]:
    """The rows of a tree below which nothing stands."""
    rows = table.records()
    below = [*(row["depth"] for row in rows[1:]), 0]
    return [row for row, depth in zip(rows, below, strict=False) if depth <= row["depth"]]


def check(found: dict[str, StatTable], got: Any) -> None:
    """Every frame and transfer is in each table once."""
    frames, transfers = len(got.frames), len(got.transfers)
    size = sum(0 if row["flags"] & 2 else len(row["data"]) for row in got.frames)
    for name in ("talkers", "io"):
        timed = name != "io" or all(row["t"] is not None for row in got.frames)
        assert total(found[name], "frames") == frames
        assert total(found[name], "bytes") == size
        if timed:
            assert sum(column(found[name], "frames")) == frames, name
            assert sum(column(found[name], "bytes")) == size
    tree = found["hierarchy"]
    assert sum(row["frames"] for row in leaves(tree)) == frames == total(tree, "frames")
    assert sum(row["bytes"] for row in leaves(tree)) == size
    assert sum(row["transfers"] for row in leaves(tree)) == transfers
    by_layer = {row["layer"]: 0 for row in leaves(tree)}
    for row in leaves(tree):
        by_layer[row["layer"]] += row["frames"]
    for verdict in VERDICTS[2:]:
        assert by_layer.get(verdict, 0) == got.verdicts.count(verdict)
    assert by_layer.get("not DroneCAN", 0) == got.verdicts.count("foreign")
    talks = column(found["talkers"], "transfers")
    assert sum(count for count in talks if count is not None) == transfers == total(found["nodes"], "transfers")
    bad = sum(row["status"] not in ("ok", "unchecked") for row in got.transfers)
    assert total(found["talkers"], "bad") == bad == total(tree, "bad")
    requests = sum(row["kind"] == "request" for row in got.transfers)
    assert total(found["services"], "requests") == requests


@pytest.mark.parametrize("name", FILES)
def test_sums(name: str, tables: Callable[..., dict[str, StatTable]], decode: Callable[..., Any]) -> None:
    text = (ROOT / name).read_bytes()
    found = tables(text, names=ALL)
    check(found, decode(text))
    assert sum(column(found["load_seconds"], "frames")) == total(found["talkers"], "frames")


@pytest.mark.parametrize("name", ["violations", "neighbours", "tm_golden_fd"])
def test_sums_of_what_is_settled_late(
    name: str, tables: Callable[..., dict[str, StatTable]], decode: Callable[..., Any], flush: object
) -> None:
    text = (VECTORS / f"{name}.log").read_bytes()
    cuts = [0, *range(400, len(text), len(text) // 7), len(text)]
    chunks = [part for a, b in pairwise(cuts) for part in (text[a:b], flush)]
    found = tables(*chunks, names=ALL)
    check(found, decode(*chunks))
    assert told(found) == told(tables(text, names=ALL))


@examples(60)
@given(capture=captures(), data=st.data())
def test_any_traffic_adds_up(
    capture: Capture,
    data: st.DataObject,
    tables: Callable[..., dict[str, StatTable]],
    decode: Callable[..., Any],
    flush: object,
) -> None:
    text = capture.data
    cuts = [0, *sorted(data.draw(st.lists(st.integers(0, len(text)), max_size=4))), len(text)]
    chunks = [part for a, b in pairwise(cuts) for part in (text[a:b], flush)]
    found = tables(*chunks, names=ALL)
    check(found, decode(*chunks))


def told(found: dict[str, StatTable]) -> dict[str, Any]:
    """All that a table says."""
    return {name: (table.rows, table.total, table.notes) for name, table in found.items()}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("where", ["", "node == 11", "can.len >= 4", "!ESCStatus"])
def test_any_cut_gives_the_same(where: str, tables: Callable[..., dict[str, StatTable]], flush: object) -> None:
    text = (ROOT / "captures/faults.log").read_bytes()
    whole = told(tables(text, names=ALL, where=where))
    for step in (len(text) // 3 + 1, len(text) // 29):
        chunks = [part for at in range(0, len(text), step) for part in (text[at : at + step], flush)]
        assert told(tables(*chunks, names=ALL, where=where)) == whole


def test_filters_share_the_frames_among_them(tables: Callable[..., dict[str, StatTable]]) -> None:
    """What a filter lets through and what it does not is everything."""
    text = (ROOT / "captures/faults.log").read_bytes()
    everything = tables(text, names=["talkers"])["talkers"]
    for where in ("node == 11", "ESCStatus", "can.len >= 4", 'dronecan.status != "ok"', "can.id & 1"):
        parts = [tables(text, names=["talkers"], where=one)["talkers"] for one in (where, f"!({where})")]
        for name in ("frames", "bytes"):
            assert sum(total(part, name) for part in parts) == total(everything, name), where


def test_each_frame_is_asked_for_its_own_time() -> None:
    """Not for the time since the row before in a list, where a transfer is one row."""
    capture, where = analyzer.open_capture(ROOT / "captures/hover.log"), "frame.time_delta >= 1 ms"
    times = capture.table("frames").column("t").cast("int64").to_pylist()
    late = sum(b - a >= 1_000_000 for a, b in pairwise(times))
    assert late > 100
    assert sum(capture.stats(f"io,1,{where}").column(where).to_pylist()) == late
    assert sum(capture.filter(where).stats("talkers").column("frames").to_pylist()) == late
