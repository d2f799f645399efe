"""Engines that make some tables only: these are what they are in all, and there are no others."""

from __future__ import annotations

import pyarrow as pa
import pytest
from kit.command import CAPTURES

import dissectors
from analyzer.decode.engine import Engine
from analyzer.filter import compile_filter

TEXT = (CAPTURES / "mission-8-faults.log").read_bytes()
ONLY = [["ESCStatus"], ["PUSHCAN.MotorStatus"], ["PUSHCAN"], ["RawCommand", "PUSHCAN.MotorStatus"], []]


def tables(only: list[str] | None) -> dict[str, pa.Table]:
    found: dict[str, list[pa.RecordBatch]] = {}
    half = len(TEXT) // 2
    for batch in Engine(only=only, ahead=True).run([TEXT[:half], b"", TEXT[half:]]):
        for name in ("frames", "transfers", "events"):
            found.setdefault(name, []).append(getattr(batch, name))
        for name, table in batch.messages.items():
            found.setdefault(name, []).append(table)
    return {name: pa.Table.from_batches(some) for name, some in found.items()}


def test_some_tables_are_what_they_are_in_all() -> None:
    every = tables(None)
    for only in ONLY:
        some = tables(only)
        assert some.keys() == {"frames", "transfers", "events", *only}
        assert all(table.equals(every[name]) for name, table in some.items()), only


@pytest.mark.parametrize(
    ("text", "asked", "shown"),
    [
        ("ESCStatus", set(), {"ESCStatus"}),
        ("ESCStatus.voltage < 44 V && src == 12", {"ESCStatus"}, {"ESCStatus"}),
        ("RawCommand || src == 12", set(), None),
        ("!ESCStatus", set(), None),
        ("dronecan.src == 12", set(), None),
        (
            "PUSHCAN.MotorStatus.speed > 0", {"PUSHCAN.MotorStatus"},
            {"PUSHCAN", "PUSHCAN.MotorStatus", "PUSHCAN.unrecognized"},
        ),
    ],
)  # fmt: skip
def test_a_filter_asks_for_what_it_names_and_a_list_for_what_it_may_select(
    text: str, asked: set[str], shown: set[str] | None
) -> None:
    found = compile_filter(text, dissectors.load())
    assert found.tables == asked
    assert (found.shown() is None) == (shown is None)
    assert shown is None or shown <= (found.shown() or set())
