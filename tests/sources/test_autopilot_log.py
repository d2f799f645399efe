"""An autopilot's own records in its dataflash log: any cut, damage, foreign files."""

from __future__ import annotations

import gzip
import io
from itertools import pairwise
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import CAPTURES, dataflash
from kit.dataflash import HEAD, description, record
from kit.strategies import examples

from analyzer._native import LogRecords
from analyzer.sources.dataflash import AutopilotLog, read_log
from analyzer.sources.errors import CaptureError

if TYPE_CHECKING:
    from pathlib import Path

NAMES = ("MSG", "EV", "BAT", "RCOU")
RECORDS = [
    record("MSG", 1_000_000, "ArduCopter V4.5.7 (2a3dc4b7)"),
    record("IMU", 1_000_500, 0, 0.1, 0.2, 0.3),
    record("EV", 2_000_000, 10),
    dataflash.battery(2_500_000, 50.25),
    record("RCOU", 3_000_000, *range(1000, 1014)),
    record("EV", 4_000_000, 11),
]
LOG = HEAD + b"".join(RECORDS)


def log(data: bytes, *names: str) -> AutopilotLog:
    file = io.BytesIO(data)
    file.name = "flight.bin"  # type: ignore[misc]
    return read_log(file, names or NAMES)


def told(found: AutopilotLog) -> dict[str, list[tuple[object, ...]]]:
    return {
        name: list(zip(table.number.tolist(), *(column.tolist() for column in table.columns.values()), strict=True))
        for name, table in found.tables.items()
    }  # fmt: skip


def test_records_as_they_were_logged() -> None:
    found = log(LOG)
    heads = len(dataflash.TYPES)
    assert (found.records, found.unreadable, found.damage, found.left) == (heads + 6, 0, None, 0)
    assert set(found.tables) == set(NAMES)
    message, event, battery, outputs = (found.table(name) for name in NAMES)
    assert message.columns["Message"].tolist() == [b"ArduCopter V4.5.7 (2a3dc4b7)"]
    assert (message.time.tolist(), message.number.tolist()) == ([1_000_000], [heads])
    assert (event.time.tolist(), event.columns["Id"].tolist()) == ([2_000_000, 4_000_000], [10, 11])
    assert event.number.tolist() == [heads + 2, heads + 5]
    assert (battery.columns["Volt"].tolist(), battery.columns["Temp"].tolist()) == ([50.25], [25.0])
    assert [outputs.columns[f"C{k}"].tolist() for k in (1, 14)] == [[1000], [1013]]
    assert len(found.table("ERR")) == 0


@given(st.lists(st.integers(1, len(LOG)), max_size=8))
@examples(60)
def test_any_cut_of_the_bytes_gives_the_same(cuts: list[int]) -> None:
    reader, whole = LogRecords(list(NAMES)), LogRecords(list(NAMES))
    edges = [0, *sorted(cuts), len(LOG)]
    parts: dict[tuple[bytes, ...], list[bytes]] = {}
    for start, end in pairwise(edges):
        reader.feed(LOG[start:end])
        for *layout, records, numbers in reader.take():
            rows = parts.setdefault(tuple(layout), [b"", b""])
            rows[:] = [rows[0] + records, rows[1] + numbers]
    reader.finish()
    whole.feed(LOG)
    whole.finish()
    assert {tuple(layout): [records, numbers] for *layout, records, numbers in whole.take()} == parts
    assert (reader.records, reader.unreadable, reader.damage) == (whole.records, 0, None)


def test_what_stands_before_the_end_is_kept() -> None:
    whole = told(log(LOG))
    for length in range(3, len(LOG)):
        found = log(LOG[:length])
        for name, rows in told(found).items():
            assert rows == whole[name][: len(rows)]
        assert found.damage is None or "dataflash log ends early" in str(found.damage)
    assert log(LOG[:-1]).damage is not None


@pytest.mark.parametrize("garbage", [b"x" * 9, b"\xa3\x95", b"\0" * 50, bytes(range(160))])
def test_damage_costs_no_sound_record(garbage: bytes) -> None:
    found = log(HEAD + RECORDS[0] + garbage + b"".join(RECORDS[1:]))
    assert {name: len(rows) for name, rows in told(found).items()} == {"MSG": 1, "EV": 2, "BAT": 1, "RCOU": 1}
    assert (found.unreadable, found.damage) == (1, None)


def test_every_wrong_byte_is_survived() -> None:
    for at in range(len(LOG)):
        damaged = bytearray(LOG)
        damaged[at] ^= 0xFF
        if at > 1:  # the mark at the start says what the file is
            log(bytes(damaged))


def test_columns_that_do_not_fit_their_length_are_told() -> None:
    wrong = description(93, "EV", "QB", "TimeUS,Id")
    wrong = wrong[:4] + bytes([30]) + wrong[5:]
    found = log(HEAD + wrong + RECORDS[0])
    assert (found.unreadable, set(found.tables)) == (1, {"MSG"})


def test_a_name_that_is_described_anew_keeps_its_order() -> None:
    other = description(120, "EV", "QBB", "TimeUS,Id,More")
    later = b"\xa3\x95" + bytes([120]) + (5_000_000).to_bytes(8, "little") + bytes([18, 7])
    table = log(LOG + other + later + record("EV", 6_000_000, 28)).table("EV")
    assert table.columns["Id"].tolist() == [10, 11, 18, 28]
    assert set(table.columns) == {"TimeUS", "Id"}


def test_more_names_than_fields() -> None:
    named = description(93, "EV", "QB", "TimeUS,Id,More,Than,There,Are")
    assert log(HEAD + named + RECORDS[2]).table("EV").columns["Id"].tolist() == [10]


def test_records_without_a_time_are_no_table() -> None:
    bare = description(93, "EV", "B", "Id")
    assert log(HEAD + bare + b"\xa3\x95\x5d\x0a").tables == {}


def test_a_packed_log_is_read(tmp_path: Path) -> None:
    path = tmp_path / "flight.bin.gz"
    path.write_bytes(gzip.compress(LOG))
    assert told(read_log(path, NAMES)) == told(log(LOG))


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "flight.bin: is empty"),
        (b"\x89MCAP0\r\n" + b"\0" * 50, "flight.bin: looks like MCAP, not like a dataflash log"),
        (b"(1.5) can0 123#00\n" * 3, "flight.bin: looks like candump text, not like a dataflash log"),
        (b"\x7fELF" + b"\0" * 50, "flight.bin: byte 0: looks like a program, which is not read"),
    ],
)
def test_another_file_is_refused(data: bytes, why: str) -> None:
    with pytest.raises(CaptureError) as refused:
        log(data)
    assert str(refused.value) == why


def test_a_file_that_is_not_there() -> None:
    with pytest.raises(CaptureError, match="No such file"):
        read_log(CAPTURES / "none.bin", NAMES)
