"""The Python API: batches and whole tables of a capture."""

from __future__ import annotations

import gzip
from typing import TYPE_CHECKING

import pandas as pd
import pytest
from kit.command import CAPTURES, HOVER

import analyzer
from analyzer.decode.by_name import example
from analyzer.tables import EVENT_ROWS, EVENTS, FRAMES, TRANSFERS, VERDICTS

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from typing import Any

    from dissectors.registry import Registry

FAULTS = CAPTURES / "faults.log"


def test_batches() -> None:
    capture = analyzer.open_capture(HOVER)
    (batch,) = capture
    assert (len(batch.frames), len(batch.transfers), batch.buses) == (1868, 1111, ("can0",))
    assert len(batch.messages["ESCStatus"]) == 240
    assert capture.totals.balanced
    assert capture.buses == ("can0",)
    assert [len(again.frames) for again in capture] == [1868]


def test_paths_and_texts_are_both_taken() -> None:
    assert analyzer.open_capture(str(HOVER)).table("frames") == analyzer.open_capture(HOVER).table("frames")


@pytest.mark.parametrize(("name", "schema"), [("frames", FRAMES), ("transfers", TRANSFERS), ("events", EVENT_ROWS)])
def test_whole_tables(name: str, schema: object) -> None:
    table = analyzer.open_capture(FAULTS).table(name)
    assert table.schema.equals(schema, check_metadata=True)
    assert table.num_rows > 0
    table.validate(full=True)


def test_message_and_packet_tables() -> None:
    capture = analyzer.open_capture(HOVER)
    status = capture.table("ESCStatus")
    assert status.num_rows == 240
    assert set(status.column("src").to_pylist()) == {11, 12, 13, 14}
    assert status.field("voltage").metadata[b"unit"] == b"V"
    assert capture.table("PUSHCAN.MotorStatus").num_rows == 40
    for alias in ("EscStatus", "uavcan.equipment.esc.Status", "esc.Status"):
        assert capture.table(alias) == status
    assert capture.table("uavcan.protocol.GetNodeInfo.Response").num_rows == 4
    assert capture.table("NodeStatus") == capture.table("uavcan.protocol.NodeStatus")
    assert capture.table("pushcan.MotorStatus") == capture.table("PUSHCAN.MotorStatus")


def test_a_type_that_does_not_occur_has_its_columns() -> None:
    capture = analyzer.open_capture(HOVER)
    for name in ("uavcan.protocol.param.GetSet.Request", "uavcan.equipment.gnss.Fix2", "PUSHCAN.unrecognized"):
        table = capture.table(name)
        assert table.num_rows == 0
        assert {"transfer", "t", "bus", "src", "trusted"} <= set(table.column_names)
    assert "longitude_deg_1e8" in capture.table("Fix2").column_names
    assert "dst" in capture.table("GetSet.Request").column_names
    empty = analyzer.open_capture("/dev/null")
    assert empty.table("ESCStatus").schema == capture.table("ESCStatus").schema
    assert empty.table("frames").num_rows == 0


@pytest.mark.slow
def test_the_columns_are_those_of_a_type_that_occurs(registry: Registry) -> None:
    found: dict[str, Any] = {}
    for path in CAPTURES.glob("*.log"):
        for batch in analyzer.open_capture(path):
            found |= batch.messages
    assert len(found) > 15
    for name, table in found.items():
        try:
            message = registry.resolve(name)
        except LookupError:
            message = registry.resolve(name.rpartition(".")[0])
        assert example(registry, message)[name].schema.equals(table.schema, check_metadata=True), name


def test_every_known_type_has_columns(registry: Registry) -> None:
    names = registry.names()
    assert len(names) > 100
    for name in names:
        assert "bits_left" in example(registry, registry.resolve(name))[name].schema.names, name


def test_names_that_nothing_has() -> None:
    capture = analyzer.open_capture(HOVER)
    with pytest.raises(LookupError, match=r"'ESCStatu' .*ESCStatus"):
        capture.table("ESCStatu")
    with pytest.raises(LookupError, match=r"PUSHCAN has no packet 'Nope' .*MotorStatus"):
        capture.table("PUSHCAN.Nope")
    with pytest.raises(LookupError, match=r"GetNodeInfo\.Request"):
        capture.table("GetNodeInfo")
    for name in ("", ".", "PUSHCAN.", "ESCStatus.MotorStatus", "\x1b[31m"):
        with pytest.raises(LookupError):
            capture.table(name)


def test_verdicts_are_the_final_ones(decode: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut into many batches, frames of one are settled by a later one."""
    expected = decode(FAULTS.read_bytes()).verdicts
    monkeypatch.setattr("analyzer.decode.core.BATCH_ROWS", 50)
    monkeypatch.setattr("analyzer.sources.stored.CHUNK", 2000)
    capture = analyzer.open_capture(FAULTS)
    assert sum(len(batch.settled) for batch in capture) > 0
    assert [VERDICTS[code] for code in capture.table("frames").column("verdict").to_pylist()] == expected


def test_events() -> None:
    kinds = [EVENTS[code] for code in analyzer.open_capture(FAULTS).table("events").column("kind").to_pylist()]
    assert sorted(kinds) == ["drop", "error frame", "error frame", "gap", "unreadable"]


def test_captures_that_cannot_be_read(tmp_path: Path) -> None:
    capture = analyzer.open_capture(tmp_path / "missing.log")  # nothing is read yet
    for read in (lambda: list(capture), lambda: capture.table("frames")):
        with pytest.raises(analyzer.CaptureError, match="No such file"):
            read()


def test_damage_behind_readable_content(tmp_path: Path) -> None:
    path = tmp_path / "cut.gz"
    path.write_bytes(gzip.compress(HOVER.read_bytes())[:-4])
    capture = analyzer.open_capture(path)
    assert capture.damage is None
    assert capture.table("transfers").num_rows == 1111
    assert "gzip data ends early" in str(capture.damage)


def test_a_folder_of_types(tmp_path: Path) -> None:
    (tmp_path / "1034.Mine.uavcan").write_text("uint8[<=20] data\n")
    table = analyzer.open_capture(FAULTS, dissectors=[tmp_path]).table("Mine")
    assert "data" in table.column_names


def test_a_plot_in_three_lines() -> None:
    table = analyzer.open_capture(HOVER).table("ESCStatus").to_pandas()
    one = table[table.esc_index == 0].set_index("t")
    assert list(one[["voltage", "current", "rpm"]].dtypes) == ["float32", "float32", "int32"]
    assert isinstance(one.index, pd.DatetimeIndex)
    assert len(one) == 60
    assert one.index.is_monotonic_increasing


def test_the_package_offers_what_it_says() -> None:
    assert {analyzer.__dict__.get(name) or getattr(analyzer, name) for name in analyzer.__all__}
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = analyzer.nothing
