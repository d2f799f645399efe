"""What witnesses a loss of the recorder (CAP-006) on a bus where little is sent, and what only looks like one."""

from __future__ import annotations

import random
from dataclasses import replace
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple

import pytest
from bench.outside.trace import Trace, write
from kit.command import CAPTURES
from kit.encode import log_line, transfer
from kit.judged import judge, whole
from kit.traffic import MS, SECOND, START, STATUS, alive

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from kit.encode import Frame, Transfer

TOOL, ESC = 127, 11
GET = "uavcan.protocol.param.GetSet"


def report(k: int, node: int = ESC) -> Transfer:
    return transfer("ESCStatus", STATUS | {"rpm": k, "esc_index": node - 10}, node, k % 32)


def asked(k: int, number: int | None = None) -> Iterator[Transfer]:
    """A request of a parameter, and the answer."""
    number = k % 32 if number is None else number
    none = {"empty": {}}
    yield transfer(f"{GET}.Request", {"index": k, "value": none, "name": []}, TOOL, number, dst=ESC)
    limits = dict.fromkeys(("default_value", "max_value", "min_value"), none)
    value = {"value": {"integer_value": k}, "name": list(b"P%03d" % k)}
    yield transfer(f"{GET}.Response", limits | value, ESC, number, dst=TOOL)


class Often(NamedTuple):
    """Something that is sent every so many ms, all transfers of it at once."""

    period: float
    make: Callable[[int], Iterable[Transfer]]


STATUSES = Often(1000, lambda k: [alive(k, ESC, k % 32)])
REPORTS = Often(100, lambda k: [report(k)])
THROTTLE = Often(200, lambda k: [transfer("RawCommand", {"cmd": [k] * 4}, 1, k % 32)])
QUESTIONS = Often(100, asked)


def sent(*all_: Often, seconds: int = 12) -> list[Frame]:
    frames: list[Frame] = []
    for n, one in enumerate(all_):
        for k in range(round(seconds * 1000 / one.period)):
            t = START + round((k + n / 7 + k * 3 % 5 / 60) * one.period * MS)
            for each in one.make(k):
                frames += each.frames(t)
                t += 3 * MS
    return sorted(frames, key=attrgetter("t"))


def recorded(frames: Iterable[Frame], seconds: float, share: float, nodes: Iterable[int] = range(128)) -> str:
    """Without a share of the frames of nodes, from 6.7 s on."""
    chance, since, nodes = random.Random(3), START + 6700 * MS, set(nodes)
    return "".join(
        log_line(one) + "\n"
        for one in frames
        if one.id & 0x7F not in nodes or not since <= one.t < since + seconds * SECOND or chance.random() >= share
    )


def faults(text: str) -> tuple[int, set[str]]:
    """How often CAP-006 is told, and who is blamed."""
    found = judge(text, ("CAN", "TRF", "CAP-006"))
    blamed = {one.rule for one in found if one.severity != "note" and one.rule != "CAP-006"}
    return sum(one.rule == "CAP-006" for one in found), blamed


@pytest.mark.parametrize("all_", [(REPORTS, THROTTLE), (REPORTS, STATUSES, QUESTIONS)])
@pytest.mark.parametrize(("seconds", "share"), [(0.4, 1.0), (1.0, 1.0), (1.2, 0.3), (3.0, 0.3)])
def test_two_senders_of_few_frames(all_: tuple[Often, ...], seconds: float, share: float) -> None:
    """A tool that only asks is one of them: its requests count up."""
    assert faults(recorded(sent(*all_), seconds, share)) == (1, set())


@pytest.mark.parametrize("nodes", [(ESC,), (1, TOOL)])
def test_what_one_of_them_loses_is_its_own(nodes: tuple[int, ...]) -> None:
    for all_ in ((REPORTS, THROTTLE), (REPORTS, STATUSES, QUESTIONS)):
        inferred, blamed = faults(recorded(sent(*all_), 1.2, 0.3, nodes))
        assert inferred == 0
        assert blamed


def test_a_tool_that_counts_otherwise_is_no_witness() -> None:
    chance = random.Random(5)
    asks = Often(100, lambda k: asked(k, chance.randrange(32)))
    assert faults(recorded(sent(REPORTS, STATUSES, asks), 1.2, 0.3, (ESC,)))[0] == 0


def test_answers_that_are_not_given_are_no_losses() -> None:
    asks = Often(100, lambda k: list(asked(k))[: 1 + (k % 11 > 1)])
    assert faults(recorded(sent(REPORTS, STATUSES, asks), 0, 1))[0] == 0


def test_any_cut_gives_the_same() -> None:
    text = recorded(sent(REPORTS, STATUSES, QUESTIONS), 1.2, 0.3)
    assert whole(text, ("CAP-006",), (1, 89))


def again(trace: Trace, seed: int, how: str) -> str:
    """A piece of a capture comes twice: at once, with all that is behind it moved, or between what is sent then."""
    chance = random.Random(seed)
    size = chance.choice([20, 60, 200, 400])
    begin = chance.randrange(len(trace.frames) - 2 * size)
    piece = trace.frames[begin : begin + size]
    at = min(begin + size + chance.choice([1, 30, 300]), len(trace.frames) - 1)
    t, first, took = trace.frames[at - 1].t, piece[0].t, piece[-1].t - piece[0].t + MS
    if how == "at once":
        new, behind = [replace(one, t=t) for one in piece], trace.frames[at:]
    else:
        new = [replace(one, t=t + MS // 2 + one.t - first) for one in piece]
        behind = [replace(one, t=one.t + took * (how == "moved")) for one in trace.frames[at:]]
    frames = [*trace.frames[:at], *new, *behind]
    return write(frames if how == "at once" else sorted(frames, key=attrgetter("t")))


@pytest.mark.sampled(6)
@pytest.mark.parametrize("how", ["at once", "moved", "between"])
@pytest.mark.parametrize("seed", range(8))
def test_frames_that_come_again_are_no_loss(seed: int, how: str) -> None:
    """It is a tool's or an attacker's work."""
    trace = Trace(CAPTURES / "hover-4.log")
    found = judge(again(trace, seed, how), ("CAP-006", "TRF", "BUS-010"))
    assert [one.rule for one in found if one.rule == "CAP-006"] == []
    assert {one.rule for one in found if one.severity != "note"}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("values", [1, 8, 100])
@pytest.mark.parametrize("seconds", [0.1, 0.4])
def test_what_says_the_same_again_and_again_may_be_lost(values: int, seconds: float) -> None:
    """What is behind the loss was there before, byte for byte, if only its ID counts."""
    chance = random.Random(values)
    escs = [Often(20, lambda _, node=node: [report(chance.randrange(values), node)]) for node in (11, 12, 13)]
    counted = [Often(20, lambda k, one=one: [replace(one.make(k)[0], transfer_id=k % 32)]) for one in escs]
    stopped = Often(10, lambda k: [transfer("RawCommand", {"cmd": [0] * 4}, 1, k % 32)])
    assert faults(recorded(sent(*counted, stopped), seconds, 1.0)) == (1, set())
