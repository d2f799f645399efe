"""How faults are asked for, when they happen, and what the key says of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from analyzer.simulate.faults import catalogue
from analyzer.simulate.faults.context import FaultOrder
from analyzer.simulate.recorder import SimulatedRecorder
from analyzer.simulate.wire import TOGGLE, retail
from analyzer.simulate.world import SimulatedWorld
from dissectors.times import MILLISECOND, SECOND
from dissectors.traffic import Answer, Case, Fault, Sending, SimulatedFrame, Step, of

if TYPE_CHECKING:
    from dissectors.registry import Registry

STATUS = "uavcan.protocol.NodeStatus"


def flip(case: Case, sending: Sending) -> Step:
    retail(sending.frames[-1], TOGGLE)
    case.say(f"flipped in transfer {sending.transfer_id}")
    return Step.DONE


FLIP = Fault("X-1", "a flipped toggle", frames=flip, fits=of(STATUS))


class Run:
    """Two devices for a while, with faults."""

    def __init__(self, registry: Registry, *orders: FaultOrder, seconds: int = 20) -> None:
        self.world = SimulatedWorld(registry, bit_rate=1_000_000, end=seconds * SECOND, seed=1)
        self.devices = [self.world.device(number, "x") for number in (9, 10)]
        for number, order in enumerate(orders):
            self.world.context.take(order, SimulatedWorld.dice(f"fault {number}", 1))
        self.heard: list[Sending] = []
        self.world.hear(STATUS, self.heard.append)
        self.frames = list(SimulatedRecorder().record(self.world.run()))
        self.answers = self.world.context.answers

    def flipped(self) -> list[int]:
        return [frame.number for frame in self.frames if frame.data[-1] & TOGGLE]


def order(fault: Fault, t: float | None = None, rate: float | None = None, **settings: Any) -> FaultOrder:
    return FaultOrder(
        fault, None if t is None else round(t * SECOND), {**fault.options, **settings}, rate=rate, text="text"
    )


def test_the_first_transfer_from_its_time_on(registry: Registry) -> None:
    run = Run(registry, order(FLIP, 7.3))
    (answer,) = run.answers
    (number,) = run.flipped()
    frame = run.frames[number - 1]
    assert (answer.rule, answer.frames, answer.t, answer.t_end) == ("X-1", [number], frame.t, frame.t)
    assert 7.3 * SECOND <= frame.t < 7.8 * SECOND
    assert (answer.node, answer.type) == (frame.id & 127, STATUS)
    assert answer.done == f"flipped in transfer {frame.data[-1] & 31}"
    assert frame.sending not in run.heard
    assert len(run.heard) == len(run.frames) - 1


def test_nothing_else_changes(registry: Registry) -> None:
    clean, run = Run(registry), Run(registry, order(FLIP, 7.3), order(FLIP, 9))
    assert len(run.flipped()) == 2
    for one, other in zip(clean.frames, run.frames, strict=True):
        assert one.number in run.flipped() or (one.data, one.t // MILLISECOND) == (other.data, other.t // MILLISECOND)


def test_without_a_time_it_is_some_time_in_the_flight(registry: Registry) -> None:
    times = {Run(registry, order(FLIP)).answers[0].t for _ in range(2)}
    assert len(times) == 1, "the same dice, the same time"
    assert 7 * SECOND <= times.pop() <= 16.6 * SECOND


def test_only_from_this_node_this_often(registry: Registry) -> None:
    run = Run(registry, order(FLIP, 5, node=10, count=3))
    assert [answer.node for answer in run.answers] == [10, 10, 10]
    assert [answer.frames for answer in run.answers] == [[number] for number in run.flipped()]
    assert run.world.context.open == []


def test_a_type_that_is_named_replaces_the_usual_ones(registry: Registry) -> None:
    never = Fault("X-2", "of a type that nobody sends", frames=flip, fits=of("uavcan.equipment.gnss.Fix2"))
    assert Run(registry, order(never, 5)).flipped() == []
    assert len(Run(registry, order(never, 5, type=STATUS)).flipped()) == 1


def test_what_found_no_occasion_stays_open(registry: Registry) -> None:
    run = Run(registry, order(FLIP, 5, node=99, count=2), order(FLIP, 6))
    assert [(one.text, one.settings["node"]) for one in run.world.context.open] == [("text", 99)] * 2
    assert len(run.answers) == 1


@pytest.mark.parametrize("rate", [0.0, 0.25, 1.0])
def test_a_rate_is_a_probability_for_each_transfer(registry: Registry, rate: float) -> None:
    run = Run(registry, order(FLIP, rate=rate), seconds=200)
    share = len(run.flipped()) / len(run.frames)
    assert abs(share - rate) < 0.07
    assert len(run.answers) == len(run.flipped())
    assert run.world.context.open == []


def test_a_rate_of_what_happens_by_itself_counts_in_seconds(registry: Registry) -> None:
    def start(case: Case) -> None:
        frame = SimulatedFrame(7, b"x")
        case.mark(frame)
        case.world.put([frame])

    fault = Fault("X-3", "a frame", start=start)
    run = Run(registry, order(fault, rate=1.0), order(fault, 3.25, count=2), seconds=10)
    times = [round(frame.t / SECOND, 3) for frame in run.frames if frame.id == 7]
    assert times == [1.0, 2.0, 3.0, 3.25, 4.0, 4.25, 5.0, 6.0, 7.0, 8.0, 9.0]
    assert all(len(answer.frames) == 1 for answer in run.answers)
    assert len(run.answers) == 11


def test_a_fault_of_several_transfers_is_one_answer(registry: Registry) -> None:
    def twice(case: Case, sending: Sending) -> Step:
        flip(case, sending)
        case.state["seen"] = case.state.get("seen", 0) + 1
        return Step.DONE if case.state["seen"] == 2 else Step.MORE

    def some(case: Case, sending: Sending) -> Step:
        return Step.SKIP if sending.transfer_id % 2 else flip(case, sending)

    for rate in (None, 0.2):
        run = Run(registry, order(Fault("X-4", "two", frames=twice, fits=of(STATUS)), rate=rate, node=9))
        assert run.answers
        assert all(len(answer.frames) == 2 for answer in run.answers[:-1])
    run = Run(registry, order(Fault("X-5", "even", frames=some), 5, count=2))
    assert all(run.frames[number - 1].data[-1] & 31 in range(0, 32, 2) for number in run.flipped())
    assert len(run.flipped()) == 2


def test_values_are_changed_before_they_are_encoded_and_still_heard(registry: Registry) -> None:
    def change(_: Case, sending: Sending) -> Step:
        sending.values["uptime_sec"] = 0xABCDEF
        return Step.DONE

    run = Run(registry, order(Fault("X-6", "uptime", values=change, fits=of(STATUS)), 5))
    (answer,) = run.answers
    assert run.frames[answer.frames[0] - 1].data[:4] == bytes.fromhex("EFCDAB00")
    assert len(run.heard) == len(run.frames)


def test_a_watch_lists_what_it_wants_until_its_end(registry: Registry) -> None:
    def start(case: Case) -> None:
        case.watch(lambda sending: sending.node == 9, case.world.now + 2 * SECOND)

    run = Run(registry, order(Fault("X-7", "watching", start=start), 5))
    (answer,) = run.answers
    assert len(answer.frames) == 4
    assert all(run.frames[number - 1].id & 127 == 9 for number in answer.frames)


def test_lost_frames_have_no_number_and_error_frames_a_line() -> None:
    answer = Answer("X", 0, "done")
    frames = [
        SimulatedFrame(1, b"a", t=1999),
        SimulatedFrame(2, b"b", t=2500, lost=True),
        SimulatedFrame(4, bytes(8), error=True, t=3000, answers=(answer,)),
        SimulatedFrame(3, b"c", t=4000, answers=(answer,)),
    ]
    recorder = SimulatedRecorder()
    out = list(recorder.record(frames))
    assert [(frame.id, frame.number, frame.t) for frame in out] == [(1, 1, 1000), (4, 0, 3000), (3, 2, 4000)]
    assert (recorder.frames, recorder.error_frames, recorder.first, recorder.last) == (2, 1, 1000, 4000)
    assert (answer.lines, answer.frames, answer.t, answer.t_end) == ([2], [2], 3000, 4000)


@pytest.mark.parametrize(
    ("text", "ns"),
    [
        ("2.5", 2_500_000_000),
        ("2.5s", 2_500_000_000),
        ("300ms", 300_000_000),
        ("40us", 40_000),
        ("1min", 60 * SECOND),
        ("1.5h", 5400 * SECOND),
        (".5", 500_000_000),
        ("0", 0),
        ("0.000000001", 1),
    ],
)
def test_times(text: str, ns: int) -> None:
    assert catalogue.nanoseconds(text) == ns
    assert catalogue.order(f"trf-003@{text}").t == ns


@pytest.mark.parametrize("text", ["", "s", "-1", "1e3", "1.2.3", "5d", "nan", "99999999", "٣", "1" * 5000])
def test_what_is_no_time(text: str) -> None:
    with pytest.raises(ValueError, match=r"is not a time|more than a day"):
        catalogue.nanoseconds(text)


def test_an_order_says_which_rule_when_and_how() -> None:
    found = catalogue.order("trf-003@2.5:node=0x0B:count=3:type=ESCStatus")
    assert (found.fault.rule, found.t, found.rate) == ("TRF-003", 2_500_000_000, None)
    assert found.settings["node"] == 11
    assert (found.settings["count"], found.settings["type"]) == (3, "ESCStatus")
    assert catalogue.order("CAN-001").t is None
    for name in ("NodeStatus", "nodestatus", "uavcan.protocol.NodeStatus"):
        assert catalogue.order(f"TRF-001:type={name}").settings["type"] == STATUS
    assert catalogue.rate("TRF-003=0.01").rate == 0.01


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("TRF-03", "near: TRF-"),
        ("", "no fault is called"),
        ("TRF-003@soon", "is not a time"),
        ("TRF-003@", "is not a time"),
        ("TYP-301@2", "holds from the start"),
        ("TRF-003:bogus=1", "'bogus=1' is no setting"),
        ("TRF-003:node", "is no setting"),
        ("TRF-003:node=x", "node=x is not a number"),
        ("TRF-003:type=Nonsense", "no message is called 'Nonsense'"),
        ("TRF-003:type=ESCStatu", "near: ESCStatus"),
        ("TRF-003:type=GetNodeInfo", "ambiguous"),
        ("TRF-003:count=0", "count=0 is not 1 to"),
        ("TRF-003:count=99999999", "is not 1 to"),
    ],
)
def test_what_is_no_order(text: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        catalogue.order(text)


@pytest.mark.parametrize("text", ["TRF-003", "TRF-003=", "TRF-003=2", "TRF-003=-0.1", "TRF-003=nan", "nope=0.1"])
def test_what_is_no_rate(text: str) -> None:
    with pytest.raises(ValueError, match=r"probability|no fault"):
        catalogue.rate(text)


def test_scenarios_have_names() -> None:
    assert catalogue.scenario("bus-break").title
    with pytest.raises(ValueError, match="near: bus-break"):
        catalogue.scenario("bus-brake")
