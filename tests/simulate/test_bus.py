"""The simulated bus: arbitration, no overlap, and the clock that drives it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from analyzer.simulate.bits import arbitration, duration
from analyzer.simulate.world import SimulatedWorld
from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic import BUS_RATES
from dissectors.traffic import Sending, SimulatedFrame

if TYPE_CHECKING:
    from dissectors.registry import Registry

END = SECOND


def quiet(registry: Registry, bit_rate: int = 1_000_000, end: int = END) -> SimulatedWorld:
    return SimulatedWorld(registry, bit_rate=bit_rate, end=end, seed=1)


sent = st.lists(
    st.tuples(st.integers(0, 3 * MILLISECOND), st.integers(0, 15) | st.integers(0, 2**29 - 1), st.binary(max_size=8)),
    min_size=1,
    max_size=40,
)


@given(sent, st.sampled_from(BUS_RATES))
def test_the_lowest_of_those_that_wait_goes_first(plan: list[tuple[int, int, bytes]], rate: int) -> None:
    world = SimulatedWorld(None, bit_rate=rate, end=100 * END, seed=1)  # type: ignore[arg-type]
    asked: dict[int, int] = {}
    frames = []
    for t, number, data in plan:
        frame = SimulatedFrame(number, data)
        frames.append(frame)
        asked[id(frame)] = t
        world.at(t, lambda frame=frame: world.put([frame]))
    out = list(world.run())
    assert sorted(map(id, out)) == sorted(map(id, frames))
    bit = SECOND // rate
    free = 0
    waiting = list(frames)
    for frame in out:
        start = frame.t + 3 * bit - duration(frame, bit)
        assert start == max(free, min(asked[id(one)] for one in waiting)), "nobody waits while the bus is free"
        rivals = [one for one in waiting if asked[id(one)] <= start]
        assert arbitration(frame) == min(arbitration(one) for one in rivals)
        same = [one for one in rivals if arbitration(one) == arbitration(frame)]
        assert asked[id(frame)] == min(asked[id(one)] for one in same), "first come, first served"
        free = start + duration(frame, bit)
        waiting.remove(frame)


def test_devices_number_transfers_and_restart(registry: Registry) -> None:
    world = quiet(registry, end=40 * SECOND)
    device = world.device(9, "x")
    world.at(30 * SECOND, device.restart)
    heard: list[Sending] = []
    world.hear("NodeStatus", heard.append)
    frames = list(world.run())
    assert len(frames) == len(heard) == 80
    before = [one for one in heard if one.t < 30 * SECOND]
    after = [one for one in heard if one.t >= 30 * SECOND]
    assert [one.transfer_id for one in before] == [n % 32 for n in range(60)]
    assert [one.transfer_id for one in after] == [n % 32 for n in range(20)]
    assert before[-1].values["uptime_sec"] == 29
    assert after[0].values["uptime_sec"] == 0


def test_a_silent_device_says_nothing_but_counts(registry: Registry) -> None:
    world = quiet(registry, end=3 * SECOND)
    device = world.device(9, "x")
    world.at(SECOND, lambda: setattr(device, "silent", True))
    world.at(2 * SECOND, lambda: setattr(device, "silent", False))
    frames = list(world.run())
    assert [frame.data[-1] & 31 for frame in frames] == [0, 1, 4, 5]


def test_listeners_hear_at_the_end_of_the_last_frame(registry: Registry) -> None:
    world = quiet(registry)
    device = world.device(9, "x")
    other = world.device(10, "y")
    heard: list[tuple[int, Sending]] = []
    world.hear("uavcan.protocol.GetNodeInfo.Response", lambda sending: heard.append((world.now, sending)))
    world.at(1000, lambda: device.send("uavcan.protocol.GetNodeInfo.Request", {}, dst=10, priority=20))
    frames = [frame for frame in world.run() if frame.sending and frame.sending.message.type_id == 1]
    ((now, answer),) = heard
    assert (answer.node, answer.dst, answer.priority, answer.transfer_id) == (10, 9, 20, 0)
    assert now == frames[-1].t
    assert len(frames) == 1 + len(answer.frames)
    assert other.status["health"] == 0


def test_a_damaged_transfer_is_heard_by_nobody(registry: Registry) -> None:
    world = quiet(registry)
    device = world.device(9, "x")
    world.device(10, "y")
    sending = device.send("uavcan.protocol.GetNodeInfo.Request", {}, dst=10)
    sending.damaged = True
    heard: list[Sending] = []
    world.hear("uavcan.protocol.GetNodeInfo.Response", heard.append)
    assert list(world.run())
    assert heard == []


def test_a_dead_bus_gives_up_what_waits_or_keeps_it(registry: Registry) -> None:
    for keep in (False, True):
        world = quiet(registry)
        frame, later = SimulatedFrame(1, b"x"), SimulatedFrame(2, b"y")
        world.at(1000, lambda world=world, keep=keep: world.block(5000, keep=keep))
        world.at(500, lambda world=world: world.block(2000))
        world.at(600, lambda world=world, frame=frame: world.put([frame]))
        world.at(1500, lambda world=world, later=later: world.put([later]))
        out = list(world.run())
        assert out == ([frame, later] if keep else [later])
        assert out[0].t - duration(out[0], 1000) + 3000 == 5000


def test_error_frames_and_the_other_interface_never_go_back_in_time(registry: Registry) -> None:
    world = quiet(registry)
    frame = SimulatedFrame(1, bytes(8))
    aside = [SimulatedFrame(4, bytes(8), error=True), SimulatedFrame(1, bytes(8), bus=1)]
    world.at(0, lambda: world.put([frame]))
    world.at(10_000, lambda: world.put(aside))
    out = list(world.run())
    assert out == [frame, *aside]
    assert [one.t for one in out] == [frame.t] * 3


def test_the_recording_can_be_cut(registry: Registry) -> None:
    world = quiet(registry)
    device = world.device(9, "x")
    sending = device.send("uavcan.protocol.GetNodeInfo.Request", {}, dst=10)
    frames = [SimulatedFrame(7, b"a"), SimulatedFrame(8, b"b")]
    world.at(50 * MILLISECOND, lambda: world.put(frames))
    world.cut(frames[0])
    out = list(world.run())
    assert out[0] is sending.frames[0]
    assert out[-1] is frames[0]


@pytest.mark.parametrize("seed", [1, 2])
def test_dice_are_apart(seed: int) -> None:
    one, same, other = SimulatedWorld.dice("a", seed), SimulatedWorld.dice("a", seed), SimulatedWorld.dice("b", seed)
    assert one.random() == same.random() != other.random()
