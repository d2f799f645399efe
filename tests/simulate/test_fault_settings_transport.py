"""Settings of faults of frames and transfers; that each fault is in the bytes is for the witness to prove."""

from __future__ import annotations

from collections import Counter
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import pytest
from kit.judged import registry

from analyzer.simulate import Simulation, SimulationSettings
from analyzer.simulate.faults import catalogue, identifiers, integrity
from dissectors.tmotor.traffic.faults import transport

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dissectors.traffic import Answer, SimulatedFrame

SECOND = 10**9
SECONDS = 4.0


class Run:
    """A simulated flight, read to its end."""

    def __init__(self, *orders: str, rates: Iterable[str] = (), seconds: float = SECONDS, **settings: Any) -> None:
        wanted = (*(catalogue.order(order) for order in orders), *(catalogue.rate(rate) for rate in rates))
        self.simulation = Simulation(
            SimulationSettings(duration=round(seconds * SECOND), orders=wanted, **{"escs": 3, **settings}), registry()
        )
        self.frames = list(self.simulation.frames())

    @property
    def answers(self) -> list[Answer]:
        return self.simulation.world.context.answers

    @property
    def answer(self) -> Answer:
        (answer,) = self.answers
        return answer

    def of(self, answer: Answer) -> list[SimulatedFrame]:
        """The frames that an answer lists."""
        wanted = set(answer.frames)
        return [frame for frame in self.frames if frame.number in wanted and not frame.error]

    @property
    def guilty(self) -> list[SimulatedFrame]:
        return self.of(self.answer)


@cache
def run(*orders: str, **settings: Any) -> Run:
    return Run(*orders, **settings)


def tails(frames: Iterable[SimulatedFrame]) -> list[str]:
    """Start, end, toggle and transfer ID of each frame: `S-0 5`."""
    found = []
    for frame in frames:
        tail = frame.data[-1]
        found.append(f"{'S' if tail & 128 else '-'}{'E' if tail & 64 else '-'}{tail >> 5 & 1} {tail & 31}")
    return found


SEQUENCES = [
    ("TRF-002", ["S-1", "--0", "-E1"]),
    ("TRF-003", ["S-0", "--0", "-E0"]),
    ("TRF-003:how=lost", ["S-0", "-E0"]),
    ("TRF-003:how=swapped", ["S-0", "-E0", "--1"]),
    ("TRF-004", ["S-0", "--1", "--1", "-E0"]),
    ("TRF-004:frame=1", ["S-0", "S-0", "--1", "-E0"]),
    ("TRF-004:frame=3", ["S-0", "--1", "-E0", "-E0"]),
    ("TRF-005", ["--1", "-E0"]),
    ("TRF-006", ["S-0", "--1", "S-0", "--1", "-E0"]),
    ("TRF-006:how=lost", ["S-0", "--1"]),
    ("TRF-008", ["S-0"]),
    ("TRF-013", ["S-0", "--1", "-E0"]),
    ("TRF-015", ["S-0", "-E1"]),
    ("TRF-017", ["S-0", "--1", "-E0", "S-0", "--1", "-E0"]),
    ("TRF-001", ["SE1"]),
]


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("order", "expected"), SEQUENCES)
def test_the_order_of_tail_bytes(order: str, expected: list[str]) -> None:
    found = tails(run(order).guilty)
    assert ([tail[:3] for tail in found], len({tail[4:] for tail in found})) == (expected, 1)


def test_frames_take_turns() -> None:
    found = tails(run("TRF-026").guilty)
    first, second = found[0][4:], found[1][4:]
    assert found == [f"{tail} {tid}" for tail in ("S-0", "--1", "-E0") for tid in (first, second)]
    assert int(second) == (int(first) + 1) % 32


SIZES = [
    ("TRF-012", [8, 6, 5]),
    ("TRF-013", [8, 8, 1]),
    ("TRF-014", [3, 8, 8]),
    ("TRF-011:how=padding", [8, 8, 8]),
    ("CAN-003", [16]),
    ("CAN-019", [15]),
    ("TRF-030", [16]),
    ("TRF-030:how=long", [20]),
    ("CAN-002", [0]),
    ("CAN-005", [0]),
    ("CAN-003:type=uavcan.protocol.GetNodeInfo.Request", [1]),
]


@pytest.mark.sampled(3)
@pytest.mark.parametrize(("order", "sizes"), SIZES)
def test_the_sizes_of_frames(order: str, sizes: list[int]) -> None:
    settings = {"seconds": 8.0} if "GetNodeInfo" in order else {}
    assert [
        len(frame.data) for frame in run(order.replace("CAN-003:type", "CAN-003@0:type"), **settings).guilty
    ] == sizes


@pytest.mark.parametrize(("rule", "pause"), [("TRF-027", 0.15), ("TRF-027", 1.2), ("TRF-007", 1.2), ("TRF-007", 2.2)])
def test_a_pause_is_as_long_as_it_should_be(rule: str, pause: float) -> None:
    *before, last = run(f"{rule}@1:pause={pause}").guilty
    assert abs((last.t - before[-1].t) / SECOND - pause) < 0.005
    assert before[-1].t - before[-3].t < SECOND // 100


@pytest.mark.sampled(6)
@pytest.mark.parametrize(
    "order",
    [
        *("TRF-016:lost=31", "TRF-016:lost=32", "TRF-016:type=uavcan.protocol.NodeStatus", "TRF-016@5.95"),
        *("TRF-025:priority=31", "TRF-023:after=0.4", "TRF-027:pause=0.1", "TRF-007:pause=1"),
        *("TRF-029:bytes=1023", "TRF-031:times=1", "CAN-015:times=2", "CAN-013:type=uavcan.protocol.NodeStatus"),
        *("TRF-007@4", "TRF-022@5.5", "CAN-015@5.8", "TRF-008:node=10", "TRF-028:node=125"),
    ],
)
def test_what_breaks_no_rule_or_cannot_be_seen_is_no_fault(order: str) -> None:
    flight = run(order, seconds=6.0)
    assert flight.simulation.unused == (order,)
    assert flight.answers == []


@pytest.mark.sampled(3)
@pytest.mark.parametrize("rule", ["TRF-007", "TRF-022", "TRF-023", "TRF-020", "TRF-027"])
@pytest.mark.parametrize("seed", range(2, 5))
def test_what_lasts_begins_early_enough(rule: str, seed: int) -> None:
    flight = run(rule, seed=seed, escs=1)
    lasts = catalogue.faults()[rule].lasts
    assert flight.answer.t + min(lasts, 0.6 * SECONDS * SECOND) < SECONDS * SECOND
    assert rule != "TRF-007" or tails(flight.guilty)[-1].startswith("-E")


def test_a_gap_is_as_wide_as_it_should_be() -> None:
    flight = run("TRF-016:lost=5:node=12")
    (frame, *_) = flight.guilty
    session = [f for f in flight.frames if f.id == frame.id and f.data[-1] & 128]
    at = session.index(frame)
    assert (session[at].data[-1] - session[at - 1].data[-1]) % 32 == 6
    assert frame.id & 127 == 12


def test_a_counter_that_stands_still_goes_on() -> None:
    flight = run("TRF-018")
    (first, *_) = flight.guilty
    session = [f.data[-1] & 31 for f in flight.frames if f.id == first.id and f.data[-1] & 128]
    steps = Counter((after - before) % 32 for before, after in pairwise(session))
    assert steps == {1: len(session) - 2, 0: 1}


def test_one_counter_counts_all_messages_of_a_node() -> None:
    flight = run("TRF-020:node=13", seconds=6.0)
    starts = [frame for frame in flight.guilty if frame.data[-1] & 128]
    ids = [frame.data[-1] & 31 for frame in starts]
    assert ids == [(ids[0] + n) % 32 for n in range(len(ids))]
    assert {frame.id & 127 for frame in starts} == {13}
    assert len({frame.id for frame in starts}) > 1
    after = [f for f in flight.frames if f.t >= starts[0].t and f.id & 255 == 13 and f.data[-1] & 128]
    assert after == starts


def test_the_second_interface_shows_the_same_but_for_one_transfer() -> None:
    flight = run("TRF-028")
    copies = [f for f in flight.frames if f.bus]
    joined = min(f.sending.t for f in copies if f.sending)
    here = [f for f in flight.frames if not f.bus and f.sending and f.sending.t >= joined]
    assert [(f.id, f.data) for f in here if f not in flight.guilty] == [(f.id, f.data) for f in copies]
    assert set(flight.guilty) < set(here)
    assert len(flight.guilty) == 3
    assert all(before.t <= after.t for before, after in pairwise(flight.frames))


SERVICES = [
    ("TRF-021", [(0, 0)]),
    ("TRF-022", [(1, 0)]),
    ("TRF-023:after=0.9", [(1, 0), (0, 900)]),
    ("TRF-024", [(1, 0), (0, 0), (0, 20)]),
    ("TRF-025", [(1, 0), (0, 0)]),
]


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("order", "expected"), SERVICES)
def test_requests_and_responses(order: str, expected: list[tuple[int, int]]) -> None:
    """Each start of transfer: is it a request, and how many ms after the first."""
    starts = [frame for frame in run(order).guilty if frame.data[-1] & 128]
    assert [(f.id >> 15 & 1, round((f.t - starts[0].t) / 1e6 / 10) * 10) for f in starts] == expected
    assert len({frame.data[-1] & 31 for frame in starts}) == 1
    assert len({frame.id >> 24 for frame in starts}) == (2 if order == "TRF-025" else 1)


@pytest.mark.parametrize("order", ["TRF-003:node=13", "CAN-014:node=12", "TRF-022:node=13", "TRF-010:node=11"])
def test_a_node_that_is_named_is_taken(order: str) -> None:
    number = int(order[-2:])
    (first, *_) = run(order).guilty
    assert number in {first.id & 127, first.id >> 8 & 127}


@pytest.mark.slow
def test_a_node_that_nobody_has_joins() -> None:
    flight = run("CAN-015:node=77")
    strange = [frame for frame in flight.guilty if frame.id >> 8 & 0xFFFF == identifiers._UNKNOWN.type_id]
    assert (len(strange), {frame.id & 127 for frame in strange}, flight.answer.node) == (12, {77}, 77)
    # The autopilot asks who it is, and is told.
    assert {frame.id & 127 for frame in flight.guilty if frame not in strange} == {10, 77}


def test_a_type_that_is_named_is_taken() -> None:
    flight = run("TRF-010:type=PUSHCAN")
    assert (flight.answer.type, len(flight.guilty)) == ("PUSHCAN", 5)
    assert run("TRF-003:type=uavcan.protocol.NodeStatus").simulation.unused == (
        "TRF-003:type=uavcan.protocol.NodeStatus",
    )


@pytest.mark.parametrize("order", ["TRF-003:how=sideways", "TRF-006:how=", "TRF-011:how=crc", "TRF-030:how=0"])
def test_a_choice_that_there_is_not_is_refused(order: str) -> None:
    with pytest.raises(ValueError, match=r"how=\w* is none of "):
        catalogue.order(order)


def test_two_faults_leave_each_other_alone() -> None:
    rules = ("TRF-002", "TRF-003", "TRF-004", "TRF-010", "TRF-012", "CAN-003", "CAN-014")
    flight = run(*(f"{rule}@2:node=12" for rule in rules))
    assert flight.simulation.unused == ()
    assert [answer.rule for answer in flight.answers] == list(rules)
    listed = [number for answer in flight.answers for number in answer.frames]
    assert len(listed) == len(set(listed))


def test_faults_that_come_with_a_probability() -> None:
    flight = Run(rates=("TRF-010=0.2", "TRF-016=0.02", "TRF-026=0.05", "CAN-002=0.1", "TRF-022=0.5"))
    often = Counter(answer.rule for answer in flight.answers)
    assert set(often) == {"TRF-010", "TRF-016", "TRF-026", "CAN-002", "TRF-022"}
    assert often["TRF-010"] > 20


@pytest.mark.slow
def test_nobody_knows_the_unknown_types() -> None:
    strangers = (identifiers._UNKNOWN, integrity._LONG, integrity._SEVERAL)
    assert [registry().message(0, message.type_id) for message in strangers] == [None] * 3
    assert registry().message(0, transport.CLOUD_LINK.type_id).signature != transport.CLOUD_LINK.signature
