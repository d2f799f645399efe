"""Dynamic allocation of node IDs: the rules of the Allocation DSDL, and the allocator that pydronecan brings."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import dronecan
import pytest
from dronecan.app.dynamic_node_id import CentralizedServer
from kit.simulated import Flown, end, flown, simulation

from analyzer.simulate.allocation import Allocator
from dissectors.times import MILLISECOND, SECOND

ALLOCATION = "uavcan.protocol.dynamic_node_id.Allocation"
FIRST, LATER = (600, 1000), (0, 400)  # ms: ranges of the request period and of the follow-up delay


@pytest.fixture(
    scope="module", params=[(1, 1), (4, 1), (4, 7), (8, 2)], ids=lambda way: f"{way[0]} ESCs, seed {way[1]}"
)
def startup(request: pytest.FixtureRequest) -> Flown:
    escs, seed = request.param
    return flown(9, flight="startup", escs=escs, seed=seed)


def unique_ids(flight: Flown) -> dict[bytes, int]:
    """Of every device that GetNodeInfo tells about, with its node ID."""
    answers = flight.of("uavcan.protocol.GetNodeInfo.Response")
    return {bytes(one.values["hardware_version"]["unique_id"]): one.node for one in answers}


@pytest.mark.sampled(2)
def test_every_esc_gets_the_id_that_it_wants(startup: Flown) -> None:
    granted = {bytes(one.values["unique_id"]): one.values["node_id"] for one in startup.of(ALLOCATION, 10)}
    granted = {unique_id: number for unique_id, number in granted.items() if number}
    assert sorted(granted.values()) == list(startup.escs)
    assert granted.items() <= unique_ids(startup).items()
    for node in startup.escs:
        (grant,) = [end(one) for one in startup.of(ALLOCATION, 10) if one.values["node_id"] == node]
        own = [one for one in startup.sent if one.node == node]
        assert min(one.t for one in own) >= grant
        first = {one.name: one.transfer_id for one in reversed(own) if one.message.kind == "message"}
        assert set(first.values()) == {0}


def test_requests_are_parts_of_a_unique_id_in_single_frames(startup: Flown) -> None:
    """Rules B and D: 6, 6 and 4 bytes, each behind what the allocator repeated."""
    ids = unique_ids(startup)
    heard = b""
    for one in startup.of(ALLOCATION):
        part = bytes(one.values["unique_id"])
        if not one.anonymous:
            heard = part
            continue
        assert len(one.frames) == 1
        assert one.values["node_id"] in startup.escs
        if one.values["first_part_of_unique_id"]:
            assert len(part) == 6
            assert any(known.startswith(part) for known in ids)
        else:
            assert len(part) == min(6, 16 - len(heard))
            assert any(known.startswith(heard + part) for known in ids)


def test_times_are_those_of_the_dsdl(startup: Flown) -> None:
    """Rules B, C and D: a request comes 600 to 1000 ms after the last message, a follow-up at most 400 ms after."""
    before, answered = 0, False
    for one in startup.of(ALLOCATION):
        if one.anonymous:
            low, high = FIRST if one.values["first_part_of_unique_id"] else LATER
            assert low <= (one.t - before) / MILLISECOND <= high
            assert one.values["first_part_of_unique_id"] or answered
        answered, before = not one.anonymous, end(one)


def test_pydronecan_allocates_the_same(startup: Flown) -> None:
    """Its own allocator, fed with the requests, answers each one as the autopilot does."""
    answers: list[Any] = []
    info = SimpleNamespace(hardware_version=SimpleNamespace(unique_id=SimpleNamespace(to_bytes=lambda: bytes(16))))
    node = SimpleNamespace(is_anonymous=False, node_id=10, node_info=info)
    node.add_handler = lambda *_: None
    node.broadcast = answers.append
    monitor = SimpleNamespace(
        add_update_handler=lambda _: None, find_all=lambda _: (), are_all_nodes_discovered=lambda: True
    )
    server = CentralizedServer(node, monitor)
    ours = [one.values for one in startup.of(ALLOCATION, 10)]
    for one in startup.of(ALLOCATION):
        if one.anonymous:
            message = dronecan.uavcan.protocol.dynamic_node_id.Allocation(
                node_id=one.values["node_id"], first_part_of_unique_id=one.values["first_part_of_unique_id"]
            )
            message.unique_id.from_bytes(bytes(one.values["unique_id"]))
            transfer = SimpleNamespace(source_node_id=0, ts_monotonic=time.monotonic())
            server._on_allocation_message(SimpleNamespace(transfer=transfer, message=message, node=node))
    theirs = [(one.node_id, one.unique_id.to_bytes()) for one in answers]
    assert theirs == [(values["node_id"], bytes(values["unique_id"])) for values in ours]
    assert len(theirs) == 3 * len(startup.escs)


def test_a_request_that_is_lost_is_made_again() -> None:
    """The allocator forgets after 500 ms; the device asks again from its first part."""
    run = simulation(6, flight="startup", escs=2)
    seen = 0

    def lose(sending: Any) -> None:
        """The second part of the first device never arrives: whoever listens first says so to the others."""
        nonlocal seen
        seen += 1
        if sending.anonymous and not sending.values["first_part_of_unique_id"] and seen < 4:
            sending.values = {**sending.values, "unique_id": b""}

    run.world._heard[ALLOCATION].insert(0, lose)
    flight = Flown(run)
    requests = [one for one in flight.of(ALLOCATION) if one.anonymous]
    assert sum(one.values["first_part_of_unique_id"] for one in requests) > 2
    assert {one.node for one in flight.of("ESCStatus")} == {11, 12}
    assert {one.values["node_id"] for one in flight.of(ALLOCATION, 10)} == {0, 11, 12}
    assert flight.frames[-1].t > 5 * SECOND


def test_an_id_that_somebody_has_is_not_given_again() -> None:
    run = simulation(1, escs=1)
    run.world.device(60, "org.example.beacon")
    run.world.device(61, "org.example.sleeper", silent=True)
    allocator = Allocator(run.world, run.world.devices[10][0], run.world.used_ids)
    assert allocator._grant(b"x" * 16, 60) == 61
    assert allocator._grant(b"y" * 16, 60) == 62
    assert allocator._grant(b"x" * 16, 60) == 61
    assert allocator._grant(b"z" * 16, 0) == 124  # 125 is the ground station's
