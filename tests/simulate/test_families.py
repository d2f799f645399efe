"""Stories that look like others, or like nothing: what the bytes show of each, and what they cannot."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from statistics import mean
from typing import TYPE_CHECKING

import pytest
from kit.simulated import fly
from witness.views import Message, by_node, messages

from analyzer.simulate.faults import catalogue
from dissectors.times import MILLISECOND, SECOND

if TYPE_CHECKING:
    from kit.simulated import Flight

pytestmark = pytest.mark.slow
STATUS, NODE_STATUS = "ESCStatus", "uavcan.protocol.NodeStatus"
ALONE = "distract=no:tail=no"
FULL = 8191


@cache
def told(text: str, seed: int = 3) -> Flight:
    story = catalogue.scenario(text)
    return fly(scenario=text, seconds=story.seconds, seed=seed, escs=max(4, story.least))


def began(flight: Flight) -> int:
    return int(flight.key["scenario"]["first_event"]["t_ns"])


def esc(flight: Flight) -> tuple[int, int]:
    """Node and index of the one that the cause is about."""
    cause = flight.key["scenario"]["cause"]
    return cause["nodes"][0], cause["channels"][0] - 1


def commands(flight: Flight) -> list[Message]:
    return messages(flight.log, "RawCommand")


def within(found: list[Message], begin: int, end: int) -> list[Message]:
    return [one for one in found if begin <= one.t < end]


def of(found: list[Message], name: str) -> float:
    return mean(abs(float(one[name])) for one in found)


def test_chipped_blades_turn_as_fast_at_less_current() -> None:
    flight = told(f"blade-damage:{ALONE}")
    t, (node, index) = began(flight), esc(flight)
    mine = by_node(flight.log, STATUS)[node]
    calm, after = within(mine, t - SECOND, t), within(mine, t + SECOND, t + 3 * SECOND)

    def speed(reports: list[Message]) -> float:
        told_ = within(commands(flight), reports[0].t, reports[-1].t)
        return of(reports, "rpm") / mean(one["cmd"][index] for one in told_)

    assert 0.95 < speed(after) / speed(calm) < 1.1, "the same speed at the same command"
    torque = [of(part, "current") / of(part, "rpm") ** 3 for part in (calm, after)]
    assert torque[1] < 0.75 * torque[0]


def test_a_crushed_cable_is_error_frames_and_then_nothing() -> None:
    flight = told("bus-fails:distract=no:tail=yes:twin=no")
    t = began(flight)
    assert all(frame.t < t + 2 * MILLISECOND for frame in flight.log.frames)
    assert len(flight.log.errors) > 20
    assert min(error.t for error in flight.log.errors) > t - MILLISECOND


def test_a_crash_check_is_zero_behind_commands_that_spread() -> None:
    flight = told(f"crash-check:{ALONE}")
    after = [one for one in commands(flight) if one.t > began(flight)]
    spread = next(one.t for one in after if max(one["cmd"]) - min(one["cmd"]) > 0.5 * FULL)
    zero = next(one.t for one in after if not any(one["cmd"]))
    (impact,) = [one["t_ns"] for one in flight.key["scenario"]["events"] if one["what"] == "impact"]
    assert spread + SECOND // 2 < zero < impact


def test_an_exchanged_esc_is_another_one_at_the_same_place() -> None:
    for name, turned in (("exchanged-esc:distract=no", False), (f"swap-flights:{ALONE}", True)):
        flight = told(name)
        uuids = {node: {one["esc_uuid"] for one in list_} for node, list_ in by_node(flight.log, "ParamGet").items()}
        (node,) = [node for node, some in uuids.items() if len(some) == 2]
        assert {len(some) for some in uuids.values()} == {1, 2}
        off = next(one["t_ns"] for one in flight.key["scenario"]["events"] if one["what"] == "power off")
        signs = []
        for first in (True, False):
            part = [one["rpm"] for one in by_node(flight.log, STATUS)[node] if (one.t < off) == first]
            signs.append(max(part, key=abs) > 0)
        assert (signs[0] != signs[1]) == turned
        uptimes = [one["uptime_sec"] for one in by_node(flight.log, NODE_STATUS)[10]]
        assert sorted(uptimes) != uptimes
        last = commands(flight)[-1]["cmd"]
        assert any(last) == turned, "the healthy one lands"


def test_an_overloaded_recorder_loses_frames_of_everybody_alike() -> None:
    flight = told("recorder-overload:distract=no")
    t = began(flight)
    for list_ in by_node(flight.log, STATUS).values():
        jumps = [b.t for a, b in pairwise(list_) if (b.transfer.first.tid - a.transfer.first.tid) % 32 != 1]
        assert jumps
        assert all(t <= jump < t + 3 * SECOND for jump in jumps)
    assert not any(commands(flight)[-1]["cmd"]), "the flight lands"


def test_a_recorder_misses_what_began() -> None:
    flight = told(f"blind-crash:{ALONE}")
    t, (node, _) = began(flight), esc(flight)
    times = [frame.t for frame in flight.log.frames]
    hole = max(pairwise(times), key=lambda pair: pair[1] - pair[0])
    lost = next(one["t_ns"] for one in flight.key["scenario"]["events"] if "loses its power" in one["what"])
    assert t - 5 * MILLISECOND < hole[0] < lost < hole[1]
    assert by_node(flight.log, STATUS)[node][-1].t <= hole[0]
    assert all(one[-1].t > hole[1] for other, one in by_node(flight.log, STATUS).items() if other != node)


def test_stalled_rotors_explain_the_voltage() -> None:
    """What breaks down at the impact is what the current costs, and ESCs say so."""
    flight = told("control-lost:distract=no:tail=yes", seed=9)
    (impact,) = [one["t_ns"] for one in flight.key["scenario"]["events"] if one["what"] == "impact"]

    def state(begin: int, end: int) -> tuple[float, float]:
        """Volts, and amperes of all."""
        parts = [within(list_, begin, end) for list_ in by_node(flight.log, STATUS).values()]
        return mean(of(part, "voltage") for part in parts if part), sum(of(part, "current") for part in parts if part)

    calm = state(impact - 4 * SECOND, impact - 3 * SECOND)
    after = state(impact + SECOND // 5, impact + SECOND // 2)
    assert after[0] < calm[0] - 4
    resistance = (calm[0] - after[0]) / (after[1] - calm[1])
    assert 0.02 < resistance < 0.03
    bits = [one for list_ in by_node(flight.log, STATUS).values() for one in list_ if one["error_count"] & 2]
    assert bits
    assert all(one.t > impact for one in bits)


def test_a_crash_is_recorded_in_pieces() -> None:
    flight = told("lossy-crash:distract=no:tail=no")
    loss = next(one["t_ns"] for one in flight.key["scenario"]["events"] if "loses frames" in one["what"])
    before, after = (within(commands(flight), at, at + SECOND // 2) for at in (loss - SECOND // 2, loss))
    assert len(before) > 190
    assert len(after) < 0.5 * len(before)


def test_times_of_the_key_are_those_of_the_recorders_clock() -> None:
    for back, by in (("yes", -7213), ("no", 7213)):
        flight = told(f"clock-crash:{ALONE}:twin=no:back={back}")
        t, (node, _) = began(flight), esc(flight)
        assert t == round(flight.key["scenario"]["first_event"]["time"] * SECOND) + flight.key["settings"][
            "start_ns"
        ] + (by * SECOND)
        stalled = [one.t for one in by_node(flight.log, STATUS)[node] if one["error_count"] >> 7 & 1]
        assert t < min(stalled) < t + SECOND // 5


def test_what_ends_a_recording_does_not_show() -> None:
    """Whoever died, the bytes are the same to the last."""
    cut, died = (told(f"{name}:distract=no") for name in ("power-cut", "autopilot-dies"))
    assert [(one.t, one.data) for one in cut.log.frames] == [(one.t, one.data) for one in died.log.frames]
    assert cut.key["scenario"]["knowable"] == died.key["scenario"]["knowable"]
    assert any(commands(cut)[-1]["cmd"])


def test_what_always_was_is_no_fault() -> None:
    """Lower motors, rear motors and the emptier pack are odd from the first second in the air to the last."""
    coaxial, aft, uneven = (told(f"{name}:distract=no") for name in ("coaxial", "aft-weight", "uneven-packs"))
    for part in (6, 10, 14):
        begin = coaxial.log.frames[0].t + part * SECOND
        flown = [
            [within(list_, begin, begin + 3 * SECOND) for _, list_ in sorted(by_node(one.log, STATUS).items())]
            for one in (coaxial, aft, uneven)
        ]
        drawn = [of(list_, "current") for list_ in flown[0]]
        assert mean(drawn[4:]) > 1.05 * mean(drawn[:4])
        speeds = [of(list_, "rpm") for list_ in flown[1]]
        assert min(speeds[:2]) > 1.03 * max(speeds[2:])
        volts = sorted(of(list_, "voltage") for list_ in flown[2])
        assert volts[1] < volts[2] - 0.3


def test_a_pack_is_unplugged_after_landing() -> None:
    flight = told("unplugged:distract=no")
    out = flight.key["scenario"]["events"][-1]["t_ns"]
    assert all(list_[-1].t <= out for list_ in by_node(flight.log, STATUS).values())
    assert commands(flight)[-1].t > out + SECOND // 2
    stopped = [one.t for one in commands(flight) if any(one["cmd"])][-1]
    assert stopped < out - SECOND // 4


def test_two_interfaces_show_the_same() -> None:
    flight = told("two-interfaces:distract=no")
    buses: dict[str, list[tuple[int, bytes]]] = {}
    for frame in flight.log.frames:
        buses.setdefault(frame.bus, []).append((frame.id, frame.data))
    first, second = buses.values()
    assert first == second


def test_branches_stop_several_rotors_at_once() -> None:
    flight = told("tree:distract=no:tail=yes")
    (hit,) = [one["t_ns"] for one in flight.key["scenario"]["events"] if "tree" in one["what"]]
    calm = [one["cmd"] for one in within(commands(flight), hit - 3 * SECOND, hit)]
    assert all(max(one) - min(one) < 0.15 * FULL for one in calm)
    stalled = {
        node
        for node, list_ in by_node(flight.log, STATUS).items()
        if any(one["error_count"] >> 7 & 1 for one in within(list_, hit, hit + SECOND // 5))
    }
    assert len(stalled) >= 2


def test_a_mute_firmware_sets_no_bit() -> None:
    for name in ("motor-stall", "deaf-esc"):
        text = f"{name}:distract=no:tail=no:mute="
        mute, says = (
            any(
                one["error_count"] & 0xFFF for list_ in by_node(told(text + word).log, STATUS).values() for one in list_
            )
            for word in ("yes", "no")
        )
        assert says
        assert not mute


def test_the_flight_before_a_crash_lands() -> None:
    flight = told(f"second-flight:{ALONE}")
    times = [one.t for one in commands(flight) if any(one["cmd"])]
    rests = [(a, b) for a, b in pairwise(times) if b - a > SECOND]
    assert len(rests) == 1
    assert rests[0][1] + 2 * SECOND < began(flight)
