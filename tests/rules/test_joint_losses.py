"""Frames that several senders lack at the same time: CAP-006, and what else is said there."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import pytest
from kit.command import CAPTURES
from kit.encode import Frame, log_line
from kit.judged import Said, judge, whole
from kit.simulated import faulted
from kit.simulated import flight as simulated
from kit.traffic import MS, SECOND, START, alive, lines, log, throttle

import analyzer

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

AUTOPILOT, ESCS = 10, (11, 12, 13, 14)
WAITS = 130_000  # ns, that a frame takes


class Line(NamedTuple):
    """A line of a log: ns from its start, the node, and the text."""

    t: int
    node: int
    text: str


def flight(name: str = "hover-4") -> list[Line]:
    found = []
    for text in (CAPTURES / f"{name}.log").read_text().splitlines(keepends=True):
        time, _, frame = text.split()
        seconds, fraction = time.strip("()").split(".")
        t = int(seconds) * SECOND + int(fraction.ljust(9, "0"))
        found.append(Line(t, int(frame.split("#")[0], 16) & 0x7F, text))
    return [one._replace(t=one.t - found[0].t) for one in found]


def without(
    log: Iterable[Line], since: float, seconds: float, share: float, nodes: Iterable[int] = range(128), seed: int = 0
) -> str:
    """The log without a share of the frames of nodes in a time."""
    chance, nodes = random.Random(seed), set(nodes)
    return "".join(
        one.text
        for one in log
        if one.node not in nodes or not since * SECOND <= one.t < (since + seconds) * SECOND or chance.random() >= share
    )


def blamed(found: Iterable[Said]) -> set[str]:
    """Rules of errors and warnings, but for those of the capture."""
    return {one.rule for one in found if one.severity != "note" and not one.rule.startswith("CAP")}


def inferred(found: Iterable[Said]) -> list[Said]:
    return [one for one in found if one.rule == "CAP-006"]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("since", [1.0, 2.0, 2.7])
def test_its_place_is_close_before_the_loss(since: float, tmp_path: Path) -> None:
    """Within the 50 ms that the report's command shows, and not at a frame of a node that sends once in a while."""
    path = tmp_path / "gap.log"
    path.write_text(without(flight(), since, 0.4, 1.0))
    (one,) = [one for one in analyzer.check(path).findings if one.rule == "CAP-006"]
    assert one.first.frame is not None
    assert 0 <= since * SECOND - flight()[one.first.frame - 1].t < 25 * MS


@pytest.mark.parametrize(
    ("since", "seconds", "share"), [(2.0, 0.4, 1.0), (2.0, 1.0, 0.3), (1.1, 0.1, 0.2), (1.0, 2.5, 1.0), (0.3, 3.0, 0.9)]
)
def test_nobody_is_blamed_for_what_the_recorder_lost(since: float, seconds: float, share: float) -> None:
    found = judge(without(flight(), since, seconds, share))
    assert blamed(found) == set()
    (one,) = inferred(found)
    assert (one.severity, one.node, one.bus) == ("warning", -1, 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hover", "hover-4", "mission-8-faults"])
@pytest.mark.parametrize("seed", range(12))
def test_wherever_frames_are_lost(name: str, seed: int) -> None:
    chance, log = random.Random(seed), flight(name)
    before, length = blamed(judge("".join(one.text for one in log))), log[-1].t / SECOND
    seconds, share = chance.choice([0.2, 0.4, 1.0, 2.0]), chance.choice([0.2, 0.3, 0.5, 0.7, 0.9, 1.0])
    since = chance.uniform(0.2, max(length - seconds - 0.2, 0.3))
    found = judge(without(log, since, min(seconds, length - since - 0.2), share, seed=seed))
    assert blamed(found) <= before
    assert len(inferred(found)) == 1


def test_what_the_recorder_says_itself_is_not_inferred() -> None:
    log = flight()
    behind = next(k for k, one in enumerate(log) if one.t >= 2.4 * SECOND)
    drop = Line(log[behind].t, 0, "DROPCOUNT: dropped 900 CAN frames on 'can0' socket (total drops 900)\n")
    text = without([*log[: behind + 1], drop, *log[behind + 1 :]], 2.0, 0.4, 1.0, range(1, 128))
    assert {one.rule for one in whole(text, ("CAP-004", "CAP-006"), steps=(211, 1500))} == {"CAP-004"}


def test_any_cut_gives_the_same() -> None:
    text = without(flight(), 2.0, 0.7, 0.3)
    rules = ("CAP-006", "TRF-003", "TRF-006", "TRF-009", "TRF-016", "TRF-026")
    assert inferred(whole(text, rules, steps=(211, 1500)))


@pytest.mark.parametrize("nodes", [(11,), (12, 13)])
def test_what_one_or_two_senders_lose_is_theirs(nodes: tuple[int, ...]) -> None:
    found = judge(without(flight(), 2.0, 1.0, 0.3, nodes))
    assert inferred(found) == []
    assert {"TRF-003", "TRF-006"} <= blamed(found)


def test_two_senders_are_all_if_there_are_no_others() -> None:
    two = [one for one in flight() if one.node in (10, 11)]
    assert len(inferred(judge(without(two, 2.0, 1.0, 0.3)))) == 1
    assert inferred(judge(without(two, 2.0, 1.0, 0.3, [11]))) == []


def overloaded() -> list[Line]:
    """For a second a node fills the bus with what it has to say, and of four others a third does not get through."""
    log, number, free, chance = [], 0, 0, random.Random(3)
    for one in flight():
        full = 2 * SECOND <= one.t < 3 * SECOND
        while full and free + 2 * WAITS <= one.t:
            free = max(free, 2 * SECOND) + WAITS
            tail = 0xC0 | number % 32
            number += 1
            text = f"({(START + free) / SECOND:.6f}) can0 08043914#FFFFFFFFFFFFFF{tail:02X}\n"
            log.append(Line(free, 20, text))
        if not (full and one.node in ESCS and chance.random() < 0.35):
            log.append(one._replace(text=f"({(START + max(one.t, free)) / SECOND:.6f}) {one.text.split(' ', 1)[1]}"))
            free = max(one.t, free) + WAITS
    return log


@pytest.mark.parametrize("bit_rate", [None, 1_000_000])
def test_a_full_bus_loses_no_frames_of_the_recorder(bit_rate: int | None) -> None:
    found = judge("".join(one.text for one in overloaded()), bit_rate=bit_rate)
    assert inferred(found) == []
    assert {"TRF-003", "TRF-006"} <= blamed(found)


def test_a_bus_with_error_frames_loses_them_itself() -> None:
    text = without(flight(), 2.0, 0.4, 1.0)
    assert inferred(judge(text, ("CAP-006",)))
    at = next(one.text for one in flight() if one.t >= 1.9 * SECOND)
    t = round(float(at[1 : at.index(")")]) * 1000) * MS
    mark = log_line(Frame(0x008, bytes(8), t, error=True)) + "\n"
    assert inferred(judge(text.replace(at, mark + at), ("CAP-006",))) == []


def test_nodes_that_restart_together_lack_nothing() -> None:
    sent = [(20.0 * k, alive(k // 50, src, k % 32)) for k in range(100) for src in ESCS]
    again = [(20.0 * k + 2500, alive(k // 50, src, k % 32)) for k in range(100) for src in ESCS]
    assert inferred(judge(log(*sent, *again), ("CAP-006",))) == []
    goes_on = [(20.0 * k + 2500, alive(k // 50 + 2, src, (k + 117) % 32)) for k in range(100) for src in ESCS]
    assert len(inferred(judge(log(*sent, *goes_on), ("CAP-006",)))) == 1


def test_frames_in_another_order_are_all_there() -> None:
    def swapped(src: int) -> list[Frame]:
        ids = [*range(20), 21, 20, *range(22, 32)]
        return [
            replace(throttle(n).frames()[0], id=0x04040600 | src, t=START + k * MS + src) for k, n in enumerate(ids)
        ]

    frames = sorted((one for src in ESCS for one in swapped(src)), key=lambda one: one.t)
    assert inferred(judge(lines(frames), ("CAP-006",))) == []


def test_other_protocols_lack_nothing() -> None:
    def foreign(k: int, src: int) -> Frame:
        return Frame(0x18FEF100 | src, bytes([k % 256, src, 0, 0, 0, 0, 0, k * 7 % 256]), START + k * MS + src)

    frames = [foreign(k, src) for k in range(300) for src in ESCS]
    assert inferred(judge(lines(frames), ("CAP-006",))) == []


@pytest.mark.slow
@pytest.mark.parametrize("escs", [2, 4, 8])
@pytest.mark.parametrize("seconds", [0.1, 0.9])
def test_a_simulated_recorder_that_loses_frames_accuses_nobody(escs: int, seconds: float) -> None:
    found = judge(simulated(f"CAP-006@3:seconds={seconds}", seconds=6, escs=escs))
    assert inferred(found)
    assert blamed(found) == set()


def test_with_one_esc_there_are_too_few_senders_for_a_joint_loss() -> None:
    assert faulted("CAP-006", escs=1).simulation.unused == ("CAP-006",)
