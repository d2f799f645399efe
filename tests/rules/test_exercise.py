"""What a capture exercised: the words of the catalogue."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kit import encode
from kit.judged import outcome, registry
from kit.simulated import flight
from kit.traffic import Traffic, lines, status, throttle

from analyzer.decode.engine import Engine
from analyzer.rules.catalogue import load
from analyzer.rules.exercised.exercise import Exercises
from analyzer.rules.view import Past

_SENT: dict[str, dict[str, Any]] = {  # types of one frame each
    "RawCommand": {"cmd": [0]},
    "uavcan.equipment.safety.ArmingStatus": {"status": 0},
    "uavcan.protocol.NodeStatus": {
        "uptime_sec": 1,
        "health": 0,
        "mode": 0,
        "sub_mode": 0,
        "vendor_specific_status_code": 0,
    },
}


def run(log: bytes, step: int = 10_000) -> Exercises:
    past, engine, seen = Past(registry(), {}), Engine(registry()), Exercises(registry(), ())
    rows = log.splitlines(keepends=True)
    for at in range(0, len(rows), step):
        for batch in [*engine.feed(b"".join(rows[at : at + step])), engine.flush()]:
            seen.feed(past.feed(batch))
    seen.feed(past.feed(engine.finish()))
    return seen


def words(*sent: encode.Transfer, bus: str = "can0") -> set[str]:
    return {word for word in run(lines(*(one.frames(bus=bus) for one in sent))).words() if ":" not in word}


def test_the_transport() -> None:
    assert words() == set()
    assert words(throttle(0)) == {"frames", "transfers", "arrays", "padded types"}
    assert words(status(0)) == {"frames", "transfers", "multi-frame", "floats", "padded types"}
    assert "fd" in words(throttle(0, fd=True))
    call = encode.transfer("uavcan.protocol.GetNodeInfo.Request", {}, 126, 0, dst=10)
    assert words(call) == {"frames", "transfers", "services"}


def test_one_node_with_two_types() -> None:
    arming = encode.transfer("uavcan.equipment.safety.ArmingStatus", {"status": 0}, 10)
    assert "several types" in words(status(0), arming)
    assert "several types" not in words(status(0), replace(arming, src=11))


def test_two_interfaces() -> None:
    log = lines(status(0).frames(), status(1).frames(bus="can1"))
    assert "several interfaces" in run(log).words()
    assert "several interfaces" not in run(lines(status(0).frames())).words()


def test_anonymous_and_unions_and_voids() -> None:
    ask = {"node_id": 0, "first_part_of_unique_id": 1, "unique_id": [1, 2, 3]}
    sent = encode.transfer("uavcan.protocol.dynamic_node_id.Allocation", ask, 0, kind="anonymous")
    assert "anonymous" in words(sent)
    assert {"unions", "voids"} <= run(flight("TYP-012@1").encode()).words()


def test_damage_and_unknown_types() -> None:
    sent = status(0).frames()
    sent[0] = replace(sent[0], data=bytes([sent[0].data[0] ^ 1]) + sent[0].data[1:])
    seen = run(lines(sent))
    assert "CRC failures" in seen.words()
    assert "type:ESCStatus" not in seen.words()
    unknown = [replace(throttle(k), type_id=20813, src=42) for k in range(80)]
    assert "unknown types" in words(*unknown)


def test_types_packets_and_their_order() -> None:
    traffic = Traffic()
    traffic.send("RawCommand", {"cmd": [0]}, 1)
    traffic.status(10)
    traffic.motor(10)
    seen = run(traffic.log)
    assert {"type:RawCommand", "type:ESCStatus", "type:PUSHCAN", "packet:MotorStatus"} <= seen.words()
    pairs = {word for word in seen.words() if word.startswith("pair:")}
    assert {"pair:RawCommand>ESCStatus", "pair:ESCStatus>MotorStatus"} <= pairs
    assert "pair:ESCStatus>RawCommand" not in pairs


@settings(max_examples=40)
@given(st.lists(st.sampled_from(tuple(_SENT)), max_size=8), st.integers(1, 9))
def test_pairs_are_of_the_first_and_the_last_whatever_the_batches(order: list[str], step: int) -> None:
    traffic = Traffic()
    for name in order:
        traffic.send(name, _SENT[name], 1)
    last = {name: at for at, name in enumerate(order)}
    expected = {
        f"pair:{one}>{other}" for one in last for other in last if one != other and order.index(one) < last[other]
    }
    seen = run(traffic.log, step).words()
    assert {word for word in seen if word.startswith("pair:")} == expected


@pytest.mark.slow
def test_nothing_depends_on_the_batches() -> None:
    log = flight(seconds=2).encode()
    assert run(log).words() == run(log, 13).words()


def test_a_flight_has_every_word_that_pages_ask_of_it() -> None:
    seen = outcome(flight(seconds=3)).words
    needed = {"frames", "transfers", "multi-frame", "arrays", "floats", "padded types", "several types", "services"}
    assert needed <= seen
    asked = {word for one in load(registry()).values() for part in one.exercised.split(",") for word in part.split("|")}
    assert {"type:RawCommand", "pair:RawCommand>ESCStatus"} <= {word.strip() for word in asked} & seen
