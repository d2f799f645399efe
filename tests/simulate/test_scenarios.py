"""Every story is in the bytes: an independent reader sees what the answer key tells."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import Any

import pytest
from kit.simulated import Flight, clean, fly
from witness.views import Message, by_node, messages

from analyzer.simulate.faults import catalogue

SECOND = 10**9
STATUS, NODE_STATUS = "ESCStatus", "uavcan.protocol.NodeStatus"
STORIES = ("esc-failure", "command-loss", "reordering", "duplicate-node", "pack-sag", "bus-break", "recording-ends")


@cache
def told(name: str) -> Flight:
    return fly(scenario=name, seconds=catalogue.scenario(name).seconds, seed=3)


def entry(flight: Flight, rule: str) -> dict[str, Any]:
    (found,) = flight.answers(rule)
    return found


def event(flight: Flight, words: str) -> int:
    (t,) = [one["t_ns"] for one in flight.key["scenario"]["events"] if words in one["what"]]
    return t


def mode(message: Message) -> int:
    return message["error_count"] >> 12 & 15


def test_all_stories_with_faults_are_offered() -> None:
    assert {name for name, story in catalogue.stories().items() if story.rules} == set(STORIES)


@pytest.mark.sampled(5)
@pytest.mark.parametrize("name", STORIES)
def test_the_key_tells_the_story(name: str) -> None:
    flight = told(name)
    story = flight.key["scenario"]
    assert story["name"] == name
    assert len(story["story"]) > 100
    assert [one["t_ns"] for one in story["events"]] == sorted(one["t_ns"] for one in story["events"]) != []
    assert flight.key["faults"]
    assert all(one["frames"] or one["lines"] for one in flight.key["faults"])
    assert flight.unused == ()


@pytest.mark.sampled(5)
@pytest.mark.parametrize("name", STORIES)
def test_another_seed_is_another_flight_with_the_same_story(name: str) -> None:
    seconds = catalogue.scenario(name).seconds
    one, other = told(name), fly(scenario=name, seconds=seconds, seed=4)
    assert [frame.data for frame in one.log.frames] != [frame.data for frame in other.log.frames]
    assert {fault["rule"] for fault in one.key["faults"]} == {fault["rule"] for fault in other.key["faults"]}


@pytest.mark.slow
def test_an_esc_fails_in_flight() -> None:
    flight = told("esc-failure")
    hot, failed = entry(flight, "TYP-305"), entry(flight, "TYP-306")
    node = failed["node"]
    mine = by_node(flight.log, STATUS)[node]
    begin, end = event(flight, "loses its cooling"), event(flight, "goes into error mode")
    before = [one["temperature"] for one in mine if one.t < begin]
    heating = [one["temperature"] for one in mine if begin < one.t < end]
    assert max(before) < 60
    assert end - begin > 1.5 * SECOND, "over seconds"
    assert all(later > sooner - 0.6 for sooner, later in pairwise(heating))
    assert heating[-1] > 110
    flagged = [one for one in mine if one["error_count"] >> 5 & 1]
    assert {number for one in flagged for number in one.numbers} == set(hot["frames"])
    assert all(one["temperature"] > 108 for one in flagged)
    broken = [one for one in mine if mode(one) == 6]
    assert {number for one in broken for number in one.numbers} == set(failed["frames"])
    assert broken[0].t - end < SECOND // 20
    assert all(mode(one) == 6 for one in mine if one.t > broken[0].t)
    index = mine[0]["esc_index"]
    commands = [one for one in messages(flight.log, "RawCommand") if one.t > broken[0].t]
    assert min(one["cmd"][index] for one in commands) > 819, "commanded more than 10 % on and on"
    standing = entry(flight, "BUS-028")
    stands = [one for one in mine if one.t > broken[0].t and one["rpm"] == 0]
    assert {number for one in stands for number in one.numbers} == set(standing["frames"])
    assert stands[-1].t - stands[0].t > 1.5 * SECOND
    others = [one for src, list_ in by_node(flight.log, STATUS).items() if src != node for one in list_]
    assert all(mode(one) == 4 and abs(one["rpm"]) > 1000 for one in others if one.t > broken[0].t)
    health = [one["health"] for one in by_node(flight.log, NODE_STATUS)[node]]
    assert set(health) == {0, 2}
    assert health == sorted(health)


@pytest.mark.slow
def test_the_autopilot_stops_commanding() -> None:
    flight = told("command-loss")
    stop = event(flight, "no more RawCommand")
    times = [one.t for one in messages(flight.log, "RawCommand")]
    assert times[-1] <= stop + SECOND // 1000
    assert flight.log.frames[-1].t - stop > 3 * SECOND
    autopilot = messages(flight.log, "RawCommand")[0].src
    assert any(one.t > stop + 3 * SECOND for one in by_node(flight.log, NODE_STATUS)[autopilot])
    for list_ in by_node(flight.log, STATUS).values():
        after = [one for one in list_ if one.t > stop + SECOND // 8]
        assert all(one["error_count"] >> 3 & 1 for one in after), "throttle loss"
        assert after[-1]["rpm"] == 0
        assert 5 in {mode(one) for one in after}, "coast-down"
        assert all(not one["error_count"] >> 3 & 1 for one in list_ if one.t < stop)
    assert len(flight.answers("TYP-305")) == 4
    assert entry(flight, "BUS-007")["t_ns"] - stop >= SECOND // 10


def test_a_node_mixes_up_its_frames() -> None:
    flight = told("reordering")
    fault = entry(flight, "TRF-003")
    broken = [one for one in flight.log.transfers if one.status == "interrupted"]
    assert len(broken) > 10
    assert {one.first.src for one in broken} == {fault["node"]}
    listed = set(fault["frames"])
    assert all(one.numbers <= listed for one in broken)
    for one in broken:
        near = [flight.log[number] for number in sorted(listed) if abs(number - one.first.number) < 40]
        mine = [frame for frame in near if frame.tid == one.first.tid and frame.id == one.first.id]
        assert mine[0].start
        assert mine[1].toggle == mine[0].toggle, "the third frame has overtaken the second"
        assert {frame.number for frame in mine} <= listed


@pytest.mark.slow
def test_two_devices_share_a_node_id() -> None:
    flight = told("duplicate-node")
    node = entry(flight, "BUS-010")["node"]
    mine = by_node(flight.log, STATUS)[node]
    assert len({one["esc_index"] for one in mine}) == 2
    for index in {one["esc_index"] for one in mine}:
        numbers = [one.transfer.first.tid for one in mine if one["esc_index"] == index]
        assert all((later - sooner) % 32 == 1 for sooner, later in pairwise(numbers))
    assert len({one["esc_uuid"] for one in by_node(flight.log, "ParamGet")[node]}) == 2
    answers = by_node(flight.log, "uavcan.protocol.GetNodeInfo.Response")[node]
    assert len({bytes(one["hardware_version"]["unique_id"]) for one in answers}) == 2
    assert len(by_node(flight.log, STATUS)) == 3


@pytest.mark.slow
def test_the_pack_sags() -> None:
    flight = told("pack-sag")
    begin = event(flight, "a cell of the pack fails")
    answers = flight.answers("TYP-305")
    assert len(answers) == 4
    for node, list_ in by_node(flight.log, STATUS).items():
        low = [one for one in list_ if one["error_count"] >> 1 & 1]
        (mine,) = [one for one in answers if one["node"] == node]
        assert {number for one in low for number in one.numbers} == set(mine["frames"])
        assert all(one["voltage"] < 41.8 for one in low)
        assert all(one["voltage"] > 42.5 for one in list_ if one.t < begin)
        assert low[0].t - begin > SECOND, "not all at once"
    late = [one["cmd"][0] for one in messages(flight.log, "RawCommand")][-200:]
    calm = [one["cmd"][0] for one in messages(flight.log, "RawCommand") if begin - SECOND < one.t < begin]
    assert sum(late) / len(late) > sum(calm) / len(calm), "the autopilot asks for more"


def test_the_bus_breaks() -> None:
    flight = told("bus-break")
    errors = entry(flight, "CAN-004")
    assert [frame.line for frame in flight.log.errors] == sorted({*errors["lines"], *entry(flight, "CAP-002")["lines"]})
    counts = [frame.data[7] for frame in flight.log.errors if frame.id & 0x200]
    assert len(counts) > 15
    assert counts == sorted(counts)
    assert counts[-1] >= 128, "error passive"
    assert any(frame.data[1] & 0x10 for frame in flight.log.errors)
    gaps = [(later.t - sooner.t, sooner.number) for sooner, later in pairwise(flight.log.lines)]
    longest, _ = max(gaps)
    assert 1.5 * SECOND < longest < 1.7 * SECOND
    after = event(flight, "contact again")
    assert any(one.t > after + SECOND for one in messages(flight.log, "RawCommand"))
    for list_ in by_node(flight.log, STATUS).values():
        first = next(one for one in list_ if one.t > after)
        before = [one["rpm"] for one in list_ if one.t < after]
        assert mode(first) in {2, 3, 5}, "every ESC missed its throttle"
        assert abs(first["rpm"]) < abs(before[-1]) / 4


@pytest.mark.slow
def test_the_recording_just_ends() -> None:
    flight, whole = told("recording-ends"), clean(seconds=catalogue.scenario("recording-ends").seconds, seed=3)
    fault = entry(flight, "TRF-008")
    assert fault["frames"][-1] == flight.log.frames[-1].number
    (last,) = [one for one in flight.log.transfers if one.status == "open"]
    assert last.numbers == set(fault["frames"])
    mine = [(frame.t, frame.id, frame.data) for frame in flight.log.frames]
    assert mine == [(frame.t, frame.id, frame.data) for frame in whole.log.frames][: len(mine)]
    assert len(mine) < 0.8 * len(whole.log.frames)
    assert all(abs(list_[-1]["rpm"]) > 1000 for list_ in by_node(flight.log, STATUS).values()), "in flight"
