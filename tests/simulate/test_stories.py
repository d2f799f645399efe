"""Crash stories: the bytes show what the key says is the cause, before anything that the impact adds."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from statistics import mean
from typing import Any

import pytest
from kit.simulated import Flight, fly
from witness.views import Message, by_node, messages

from analyzer.simulate.faults import catalogue
from dissectors.times import SECOND

STATUS, NODE_STATUS = "ESCStatus", "uavcan.protocol.NodeStatus"
KINDS = {
    "propeller-lost": "propulsion",
    "motor-stall": "esc",
    "second-flight": "esc",
    "desync": "esc",
    "derating": "esc",
    "blade-damage": "propulsion",
    "heavy-lift": "thrust",
    "pack-lost": "battery",
    "two-packs": "battery",
    "esc-power": "wiring",
    "esc-wire": "wiring",
    "deaf-esc": "wiring",
    "esc-brown-out": "wiring",
    "bus-fails": "bus",
    "duplicate-index": "address",
    "control-lost": "control",
    "autopilot-reboot": "commands-lost",
    "zero-in-air": "commanded",
    "crash-check": "control",
    "swapped-esc": "setup",
    "swap-flights": "setup",
    "exchanged-esc": "none",
    "bad-recorder": "none",
    "recorder-overload": "recorder",
    "lossy-crash": "control",
    "blind-crash": "wiring",
    "clock-crash": "esc",
    "power-cut": "battery",
    "autopilot-dies": "device",
    "landing": "none",
    "coaxial": "none",
    "coaxial-failure": "propulsion",
    "aft-weight": "none",
    "uneven-packs": "none",
    "unplugged": "none",
    "two-interfaces": "none",
    "tree": "none",
    "clock-step": "none",
    "gps-restart": "device",
    "esc-failure": "esc",
    "command-loss": "commands-lost",
    "reordering": "none",
    "duplicate-node": "address",
    "pack-sag": "battery",
    "bus-break": "bus",
    "recording-ends": "recorder",
}
OF_ONE = (
    *(
        "propeller-lost",
        "coaxial-failure",
        "blade-damage",
        "motor-stall",
        "second-flight",
        "desync",
        "derating",
        "esc-failure",
    ),
    *(
        "clock-crash",
        "esc-power",
        "esc-wire",
        "deaf-esc",
        "esc-brown-out",
        "blind-crash",
        "swapped-esc",
        "swap-flights",
    ),
)
OF_SEVERAL = ("duplicate-index", "duplicate-node", "two-packs")
# What nobody can know from what was recorded.
HIDDEN = {"power-cut", "autopilot-dies"}
ALONE = "distract=no:tail=no"


@cache
def told(text: str, seed: int = 3, escs: int = 4, **settings: Any) -> Flight:
    story = catalogue.scenario(text)
    return fly(scenario=text, seconds=story.seconds, seed=seed, escs=max(escs, story.least), **settings)


def truth(flight: Flight) -> dict[str, Any]:
    """Cause and first event, of one ESC."""
    story = flight.key["scenario"]
    cause, first = story["cause"], story["first_event"] or {}
    node, ch = ([*cause[name], None][0] for name in ("nodes", "channels"))
    return {"kind": cause["kind"], "t_ns": first.get("t_ns"), "node": node, "ch": ch}


def event(flight: Flight, words: str) -> int:
    (t,) = [one["t_ns"] for one in flight.key["scenario"]["events"] if words in one["what"]]
    return int(t)


def reports(flight: Flight, node: int) -> tuple[list[Message], list[Message]]:
    """What an ESC reports before the cause, and from 0.3 s to 0.6 s after it."""
    t, mine = truth(flight)["t_ns"], by_node(flight.log, STATUS).get(node, [])
    calm = [one for one in mine if t - SECOND < one.t < t]
    return calm, [one for one in mine if t + 0.3 * SECOND < one.t < t + 0.6 * SECOND]


def of(found: list[Message], name: str) -> float:
    return mean(abs(float(one[name])) for one in found)


@pytest.mark.sampled(6)
@pytest.mark.parametrize("name", KINDS)
def test_the_key_has_the_true_cause(name: str) -> None:
    flight = told(name)
    story, capture = flight.key["scenario"], flight.key["capture"]
    cause, first = story["cause"], story["first_event"]
    assert cause["kind"] == KINDS[name]
    assert (cause["kind"] in story["knowable"]) == (name not in HIDDEN)
    assert len(cause["channels"]) == (1 if name in OF_ONE else len(cause["channels"]) if name in OF_SEVERAL else 0)
    assert bool(cause["channels"]) == (name in (*OF_ONE, *OF_SEVERAL))
    assert (first is None) == (cause["kind"] == "none")
    if first is not None:
        assert capture["first_ns"] <= first["t_ns"] + SECOND
        assert first["t_ns"] <= capture["last_ns"] + SECOND // 100
        assert first["t_ns"] <= first["t_end_ns"]
        assert first["what"] in {one["what"] for one in story["events"]}
    times = [one["time"] for one in story["events"]]
    assert times == sorted(times)


def test_every_story_has_a_cause() -> None:
    assert set(catalogue.stories()) == set(KINDS)


@pytest.mark.slow
def test_few_reports_may_leave_it_open() -> None:
    name = f"desync:recovers=yes:{ALONE}"
    fast, slow = (told(name, rate=rate).key["scenario"]["knowable"] for rate in (50, 10))
    assert fast == ["esc"]
    assert set(slow) == {"esc", "control", "unknown"}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", [name for name in KINDS if "twin" in catalogue.scenario(name).options])
def test_in_the_twin_control_is_lost_before_it(name: str) -> None:
    flight = told(f"{name}:twin=yes:{ALONE}")
    found = truth(flight)
    assert (found["kind"], found["node"]) == ("control", None)
    events = [one["what"] for one in flight.key["scenario"]["events"]]
    first = flight.key["scenario"]["first_event"]["what"]
    assert "diverges" in first or "not on the bus" in first
    assert "impact" in events[1:]
    commands = [one["cmd"] for one in messages(flight.log, "RawCommand") if one.t > found["t_ns"]]
    assert max(max(one) - min(one) for one in commands) > 3000, "they spread"


@pytest.mark.slow
def test_without_the_tail_the_recording_ends_at_the_impact() -> None:
    flight = told(f"propeller-lost:{ALONE}")
    assert 0 <= event(flight, "impact") - flight.log.frames[-1].t < SECOND // 100
    tail = told("propeller-lost:distract=no:tail=yes")
    after = [one for list_ in by_node(tail.log, STATUS).values() for one in list_ if one.t > event(tail, "impact")]
    assert any(one["error_count"] >> 7 & 1 for one in after), "rotors stall"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gps-restart:tail=yes", "it takes none"),
        ("desync:tail", "tail=yes or no, twin=yes or no"),
        ("desync:tail=maybe", "recovers=yes or no"),
        ("desink", "near: desync"),
    ],
)
def test_what_is_no_setting_is_told(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        catalogue.story_options(text)


@pytest.mark.slow
def test_a_motor_without_its_propeller_is_fast_and_draws_nothing() -> None:
    flight = told(f"propeller-lost:{ALONE}")
    node = truth(flight)["node"]
    calm, after = reports(flight, node)
    assert of(after, "current") / of(after, "rpm") ** 2 < 0.5 * of(calm, "current") / of(calm, "rpm") ** 2
    assert of(after, "rpm") > 1.1 * of(calm, "rpm")
    assert all(not one["error_count"] & 0xFFF for one in after)


@pytest.mark.slow
def test_a_blocked_motor_stands_and_says_so() -> None:
    flight = told(f"motor-stall:{ALONE}")
    calm, after = reports(flight, truth(flight)["node"])
    assert of(after, "rpm") < 0.05 * of(calm, "rpm")
    assert of(after, "current") > 1.5 * of(calm, "current")
    assert all(one["error_count"] >> 7 & 1 for one in after)


@pytest.mark.slow
def test_a_motor_out_of_step_loses_speed_and_says_nothing() -> None:
    flight = told(f"desync:recovers=no:{ALONE}")
    calm, after = reports(flight, truth(flight)["node"])
    assert of(after, "rpm") < 0.6 * of(calm, "rpm")
    assert all(not one["error_count"] & 0xFFF for one in after)
    back = told(f"desync:recovers=yes:{ALONE}", escs=8)
    t, mine = truth(back)["t_ns"], by_node(back.log, STATUS)[truth(back)["node"]]
    assert of([one for one in mine if one.t > t + SECOND], "rpm") > 0.7 * of(reports(back, mine[0].src)[0], "rpm")


@pytest.mark.slow
def test_an_esc_that_limits_itself_gives_less_than_it_is_told() -> None:
    flight = told(f"derating:{ALONE}", escs=8)
    found = truth(flight)
    _, after = reports(flight, found["node"])
    assert {one["power_rating_pct"] for one in after} == {36}
    told_ = [one["cmd"][found["ch"] - 1] for one in messages(flight.log, "RawCommand") if one.t > after[0].t]
    assert mean(told_) > 0.42 * 8191


@pytest.mark.slow
def test_a_heavy_vehicle_needs_all_it_has() -> None:
    flight = told(f"heavy-lift:{ALONE}")
    up = truth(flight)["t_ns"] + 8 * SECOND
    late = [one["cmd"] for one in messages(flight.log, "RawCommand") if one.t > up]
    assert mean(mean(one) for one in late) > 0.85 * 8191
    for list_ in by_node(flight.log, STATUS).values():
        assert all(one["power_rating_pct"] > 70 for one in list_ if one.t > up)


@pytest.mark.slow
def test_without_the_pack_all_are_silent_but_the_autopilot() -> None:
    flight = told("pack-lost:distract=no:tail=yes")
    t = truth(flight)["t_ns"]
    assert all(one[-1].t <= t for one in by_node(flight.log, STATUS).values())
    assert any(one.t > t + SECOND for one in messages(flight.log, "RawCommand"))


@pytest.mark.slow
def test_half_of_the_motors_lose_their_voltage() -> None:
    flight = told(f"two-packs:{ALONE}")
    t = truth(flight)["t_ns"] + 1.2 * SECOND
    volts = {
        node: mean(one["voltage"] for one in list_ if t < one.t < t + SECOND)
        for node, list_ in by_node(flight.log, STATUS).items()
    }
    low = sorted(volts.values())
    assert low[1] < low[2] - 4


@pytest.mark.slow
def test_the_silence_of_a_wire_is_not_a_restart() -> None:
    wire, restart, power = (told(f"{name}:{ALONE}", escs=8) for name in ("esc-wire", "esc-brown-out", "esc-power"))
    for flight, falls in ((wire, False), (restart, True)):
        node = truth(flight)["node"]
        uptimes = [one["uptime_sec"] for one in by_node(flight.log, NODE_STATUS)[node]]
        assert (sorted(uptimes) != uptimes) == falls
    mine = by_node(wire.log, STATUS)[truth(wire)["node"]]
    steps = {(b.transfer.first.tid - a.transfer.first.tid) % 32 for a, b in pairwise(mine)}
    assert steps - {1}, "its transfer IDs jump"
    assert by_node(power.log, STATUS)[truth(power)["node"]][-1].t <= truth(power)["t_ns"]


@pytest.mark.slow
def test_a_deaf_esc_reports_throttle_loss_while_the_bus_carries_it() -> None:
    flight = told(f"deaf-esc:{ALONE}", escs=8)
    _, after = reports(flight, truth(flight)["node"])
    assert all(one["error_count"] >> 3 & 1 for one in after)
    others = [list_ for node, list_ in by_node(flight.log, STATUS).items() if node != truth(flight)["node"]]
    assert not any(one["error_count"] >> 3 & 1 for list_ in others for one in list_)


def test_two_escs_report_one_index() -> None:
    flight = told(f"duplicate-index:{ALONE}")
    first, second = (by_node(flight.log, STATUS)[node] for node in (11, 12))
    assert {one["esc_index"] for one in (*first, *second)} == {0}


@pytest.mark.slow
def test_the_autopilot_restarts() -> None:
    flight = told("autopilot-reboot:distract=no:tail=yes", seed=5)
    uptimes = [one["uptime_sec"] for one in by_node(flight.log, NODE_STATUS)[10]]
    times = [one.t for one in messages(flight.log, "RawCommand")]
    assert max(b - a for a, b in pairwise(times)) > SECOND or times[-1] <= truth(flight)["t_ns"]
    assert sorted(uptimes) != uptimes or flight.log.frames[-1].t < event(flight, "restarts") + 5 * SECOND


@pytest.mark.slow
def test_zero_is_commanded_in_the_air() -> None:
    flight = told(f"zero-in-air:{ALONE}")
    after = [one["cmd"] for one in messages(flight.log, "RawCommand") if one.t > truth(flight)["t_ns"] + SECOND // 20]
    assert after
    assert all(not any(one) for one in after)


@pytest.mark.slow
def test_a_motor_turns_the_wrong_way() -> None:
    flight = told(f"swapped-esc:{ALONE}")
    sane = told(f"control-lost:{ALONE}")
    channel = truth(flight)["node"]

    def turning(one: Flight) -> bool:
        return max(by_node(one.log, STATUS)[channel], key=lambda report: abs(report["rpm"]))["rpm"] > 0

    assert turning(flight) != turning(sane)


@pytest.mark.slow
def test_the_clock_steps_and_everything_runs_on() -> None:
    flight = told("clock-step")
    times = [frame.t for frame in flight.log.frames]
    steps = [b - a for a, b in pairwise(times) if abs(b - a) > SECOND]
    assert len(steps) == 1
    assert abs(abs(steps[0]) - 7213 * SECOND) < SECOND // 100
    said = sorted(by_node(flight.log, NODE_STATUS)[10], key=lambda one: min(one.numbers))
    uptimes = [one["uptime_sec"] for one in said]
    assert uptimes == sorted(uptimes)


@pytest.mark.slow
def test_a_gps_receiver_restarts() -> None:
    flight = told("gps-restart")
    assert not by_node(flight.log, STATUS)
    assert {frame.src for frame in flight.log.frames} == {10, 42, 50}
    t = truth(flight)["t_ns"]
    uptimes = [one["uptime_sec"] for one in by_node(flight.log, NODE_STATUS)[42]]
    assert sorted(uptimes) != uptimes
    fields, fixes = (
        [frame.t for frame in flight.log.frames if frame.id >> 8 & 0xFFFF == code] for code in (1002, 1063)
    )
    assert fields[-1] <= t < fixes[-1]
    assert max(b - a for a, b in pairwise(fixes)) > 7 * SECOND
