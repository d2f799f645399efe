"""Indexes, sources of throttle, channels, and the words for what a vehicle did."""

from __future__ import annotations

import pytest
from kit.flight import Vehicle, found
from kit.judged import outcome, registry

from analyzer.decode.engine import Engine
from analyzer.rules.judge import Judge
from dissectors.tmotor.rules.vehicle import VehicleExercise


def test_more_than_eight_escs() -> None:
    for count in (8, 10):
        vehicle = Vehicle()
        sent = [vehicle.status(10 * k + 100 * n, 11 + k) for n in range(2) for k in range(count)]
        said = found(vehicle, "BUS-008")
        assert [(one.frames, one.text) for one in said] == [((sent[8].frames[0],), "10 ESC nodes")] * (count > 8)


@pytest.mark.parametrize(("apart", "count"), [(500, 3), (1500, 0)])
def test_one_index_in_two_nodes(apart: float, count: int) -> None:
    vehicle = Vehicle()
    for k in range(4):
        vehicle.status(k * apart, 13 + k % 2, esc_index=2)
        vehicle.status(k * apart + 5, 11)
    said = found(vehicle, "BUS-009")
    assert sum(one.count for one in said) == count
    assert all((one.node, one.text) == (14, "index 2 in nodes 13 and 14") for one in said)


@pytest.mark.parametrize(("apart", "count"), [(900, 1), (1100, 0)])
def test_two_sources_of_throttle(apart: float, count: int) -> None:
    vehicle = Vehicle()
    vehicle.command(0, 0)
    late = vehicle.command(apart, 0, src=126)
    said = found(vehicle, "BUS-023")
    assert [(one.frames, one.text) for one in said] == [((late.frames[0],), "nodes 1 and 126")] * count


def test_an_esc_beyond_the_channels() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 3000, 0, 0)
    sent = [*vehicle.statuses(0, 3000, 13, 100), *vehicle.statuses(50, 3000, 12, 100)]
    (one,) = found(vehicle, "BUS-026")
    assert (one.node, one.text, one.count) == (13, "index 2, commands have 2 channels", 20)
    assert one.first == sent[10].frames[0]


def test_short_commands_for_less_than_a_second() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 2000, 0, 0, 0)
    vehicle.commands(2000, 2900, 0, 0)
    vehicle.commands(2900, 4000, 0, 0, 0)
    vehicle.statuses(0, 4000, 13, 100)
    assert found(vehicle, "BUS-026") == []


def test_reports_without_commands_are_not_judged() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 500, 0)
    vehicle.statuses(1600, 4000, 13, 100)
    assert found(vehicle, "BUS-026") == []


def test_channels_without_an_esc() -> None:
    vehicle = Vehicle()
    first = vehicle.command(0, 0, 0)
    wide = vehicle.command(10, 0, 0, 0)
    vehicle.status(20, 11)
    said = found(vehicle, "BUS-027")
    assert [(one.text, one.frames) for one in said] == [
        ("ch2 has no ESC", (first.frames[0],)),
        ("ch3 has no ESC", (wide.frames[0],)),
    ]
    alone = Vehicle()
    alone.command(0, 0)
    assert found(alone, "BUS-027") == []


def words(vehicle: Vehicle) -> frozenset[str]:
    return outcome(vehicle.finish()).words & {
        "several ESCs", "motors running", "motors at rest", "negative throttle", "bad throttle"
    }  # fmt: skip


def test_words_for_what_a_vehicle_did() -> None:
    resting, flying, odd, stopping = Vehicle(), Vehicle(), Vehicle(), Vehicle()
    resting.commands(0, 100, 0)
    resting.status(50)
    flying.commands(0, 100, 500, 500)
    flying.status(50, rpm=900)
    flying.status(55, 12, rpm=900)
    odd.commands(0, 100, -500)
    stopping.commands(0, 100, 500)
    stopping.statuses(0, 400, rpm=900)
    assert words(resting) == {"motors at rest"}
    assert words(flying) == {"motors running", "several ESCs"}
    assert words(odd) == {"motors at rest", "negative throttle", "bad throttle"}
    assert words(stopping) == {"motors running", "bad throttle"}


@pytest.mark.slow
def test_how_long_motors_turned_and_who_reports() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 1000, 0)
    vehicle.commands(1000, 3000, 800)
    vehicle.commands(3000, 4000, 0)
    vehicle.statuses(0, 4000)
    text = vehicle.finish().encode()
    for step in (None, 7):
        seen, engine, judge = VehicleExercise(), Engine(registry()), Judge(registry())
        lines = text.splitlines(keepends=True)
        for at in range(0, len(lines), step or len(lines)):
            for batch in (*engine.feed(b"".join(lines[at : at + (step or len(lines))])), engine.flush()):
                seen.feed(judge.feed(batch))
        assert abs(seen.running_ns - 2_000_000_000) < 1_000_000
        assert seen.escs == {(0, 11): {0}}


def test_escs_are_labelled_by_channel() -> None:
    vehicle = Vehicle()
    vehicle.status(0, 16)
    assert outcome(vehicle.finish()).labels == {(0, 16): "ch6"}
