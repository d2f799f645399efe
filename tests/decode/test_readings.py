"""How nodes' doubtful fields are read: decided once, the same for all rows that could wait, never told otherwise."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pytest
from kit.traffic import Traffic

from analyzer.decode.readings import ENOUGH, Readings
from dissectors.schema import Evidence, Reading

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors import Registry


def reports(*values: tuple[int, float]) -> bytes:
    """ESCStatus of nodes with these temperatures."""
    traffic = Traffic()
    for node, temperature in values:
        traffic.status(node, temperature=temperature, error_count=4 << 12)
    return traffic.log


def celsius(got: Any, node: int) -> list[float]:
    return [round(row["temperature_celsius"], 2) for row in got.messages["ESCStatus"] if row["src"] == node]


def column(got: Any, node: int, name: str) -> list[Any]:
    return [row[name] for row in got.messages["ESCStatus"] if row["src"] == node]


@pytest.mark.parametrize("ahead", [False, True])
def test_a_node_in_degrees_does_not_turn_cold_at_200(decode: Callable[..., Any], ahead: bool) -> None:
    hot = [25.0] * ENOUGH + [190.0, 199.0, 200.0, 205.0, 230.0]
    got = decode(reports(*((11, one) for one in hot)), ahead=ahead)
    assert celsius(got, 11) == hot
    assert column(got, 11, "temperature") == hot
    assert column(got, 11, "decided")[ENOUGH:] == [True] * 5


@pytest.mark.parametrize("ahead", [False, True])
def test_a_cold_node_in_kelvin_stays_one(decode: Callable[..., Any], ahead: bool) -> None:
    cold = [252.0] * ENOUGH + [198.0, 300.0]
    got = decode(reports(*((11, one) for one in cold)), ahead=ahead)
    assert celsius(got, 11) == [-21.15] * ENOUGH + [-75.15, 26.85]


def test_rows_that_can_wait_are_read_as_the_node_turns_out(decode: Callable[..., Any], flush: object) -> None:
    hot = [205.0, 199.0, 201.0, 198.0]
    data = reports(*((11, one) for one in hot))
    whole = decode(data, ahead=True)
    assert celsius(whole, 11) == hot
    assert column(whole, 11, "decided") == [True] * 4
    live = decode(data)
    assert celsius(live, 11) == [-68.15, 199.0, 201.0, 198.0]
    assert column(live, 11, "decided") == [False, True, True, True]
    pieces = [piece for line in data.splitlines(keepends=True) for piece in (line, flush)]
    assert decode(*pieces).messages == live.messages


def test_nodes_are_decided_each_for_itself(decode: Callable[..., Any]) -> None:
    some = [(10, 300.0), (11, 40.0), (12, 300.0), (12, 40.0), (13, 0.0), (13, 300.0)] * 30
    got = decode(reports(*some), ahead=True)
    assert set(celsius(got, 10)) == {26.85}
    assert set(celsius(got, 11)) == {40.0}
    assert set(celsius(got, 12)) == set(celsius(got, 13)) - {0.0} | {40.0}  # neither: each value for itself
    assert column(got, 12, "reading.temperature") == [None] * 60
    stated = {one.node: one.choice for one in got.batches[-1].readings if one.reading == "temperature"}
    assert stated == {10: "K", 11: "degC", 12: "undecided", 13: "undecided"}


@pytest.mark.parametrize("ahead", [False, True])
def test_what_is_decided_stays(decode: Callable[..., Any], flush: object, ahead: bool) -> None:
    """A counter of a stock node that grows into the bits of the mode is no status."""
    traffic = Traffic()
    for errors in (*[4095] * ENOUGH, 4096, 4097):
        traffic.status(11, error_count=errors)
    data = traffic.log
    got = decode(data, ahead=ahead)
    assert column(got, 11, "reading.dialect") == ["dronecan"] * (ENOUGH + 2)
    assert column(got, 11, "decided") == [ahead] * (ENOUGH - 1) + [True] * 3
    assert ("dialect", "dronecan") in [(one.reading, one.choice) for one in got.batches[-1].readings]
    assert decode(data[: len(data) // 2], flush, data[len(data) // 2 :], ahead=ahead).messages["ESCStatus"][-1][
        "decided"
    ]


def test_a_reading_can_be_forced(decode: Callable[..., Any]) -> None:
    data = reports((11, 300.0), (12, 300.0))
    got = decode(data, forced={11: ["degC", "dronecan"]})
    assert (celsius(got, 11), celsius(got, 12)) == ([300.0], [26.85])
    assert column(got, 11, "decided") == [True]
    assert column(got, 11, "reading.dialect") == ["dronecan"]
    assert {one.choice for one in got.batches[-1].readings if one.node == 11} >= {"degC (forced)", "dronecan (forced)"}


def test_damaged_reports_decide_nothing(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for _ in range(3):
        traffic.status(11, temperature=150.0, broken=True)
    traffic.status(11, temperature=300.0)
    got = decode(traffic.log, ahead=True)
    assert set(column(got, 11, "reading.temperature")) == {"K"}


def test_evidence_that_must_hold_always(registry: Registry) -> None:
    message = replace(
        registry.resolve("RawCommand"),
        derived=(),
        readings=(
            Reading("always", "cmd", ("a", "b"), (Evidence("a", "cmd", Fraction(0), Fraction(10), every=True),), "b"),
            Reading("once", "cmd", ("a", "b"), (Evidence("a", "cmd", Fraction(0), Fraction(10)),)),
            Reading("sends", "cmd", ("a", "b"), (Evidence("a", sends=("RawCommand",)),)),
        ),
    )

    def sent(first: int, *rows: tuple[int, list[int], bool]) -> Any:
        columns = {"bus": [0] * len(rows), "src": [r[0] for r in rows], "cmd": [r[1] for r in rows],
                   "trusted": [r[2] for r in rows], "transfer": [first + k for k in range(len(rows))]}  # fmt: skip
        types = {"bus": pa.uint8(), "src": pa.uint8(), "cmd": pa.list_(pa.int16()), "trusted": pa.bool_(),
                 "transfer": pa.uint64()}  # fmt: skip
        table = pa.record_batch({k: pa.array(columns[k], kind) for k, kind in types.items()})
        senders, trusted, transfers = (np.array(columns[name]) for name in ("src", "trusted", "transfer"))
        return {"RawCommand": SimpleNamespace(
            nodes=np.unique(senders[trusted]), senders=senders, trusted=trusted, transfers=transfers,
            table=lambda places: table.take(pa.array(places)),
        )}  # fmt: skip

    readings = Readings([message], {}, ahead=False)
    readings.learn(sent(0, (1, [5], True), (2, [5, 99], True), (3, [50], True), (4, [5], False)), last=False)
    readings.learn(sent(4, (1, [6], True), (1, [], True), (1, [700], False)), last=True)
    assert {(s.reading, s.node): s.choice for s in readings.statements()} == {
        ("always", 1): "a", ("always", 2): "b", ("always", 3): "b",
        ("once", 1): "a", ("once", 2): "a", ("once", 3): "undecided",
        ("sends", 1): "a", ("sends", 2): "a", ("sends", 3): "a",
    }  # fmt: skip
