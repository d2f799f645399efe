"""Nodes that fall silent, messages that stop, and what only looks like that."""

from __future__ import annotations

from random import Random
from typing import TYPE_CHECKING

import pytest
from bench.campaign import flown
from kit.encode import Transfer, log_line
from kit.flight import Vehicle, node_status
from kit.judged import Said, whole
from kit.traffic import ALIVE, MS, START, Timed, alive, log

import analyzer
from analyzer.decode.engine import Engine
from analyzer.rules import recent
from analyzer.rules.judge import Judge

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

COMPASS, FIX = "uavcan.equipment.ahrs.MagneticFieldStrength", "uavcan.equipment.gnss.Fix2"
RULES = ("BUS-020", "BUS-035")
DROP = "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)\n"


def compass(k: int, src: int = 21) -> Transfer:
    return Transfer("message", 1001, src, bytes([k % 256, 0x3C] * 3), 0xE2A7D4A9460BC2F2, k % 32)


def fix(k: int, src: int = 21) -> Transfer:
    return Transfer("message", 1063, src, bytes([k % 256]) + bytes(47), 0xCA41E7000F37435F, k % 32)


def beats(times: Iterable[int], src: int = 21) -> list[Timed]:
    return [(t, alive(100 + t // 1000, src, k % 32)) for k, t in enumerate(times)]


def others(stop: int, period: int = 1000) -> list[Timed]:
    """Another node that goes on."""
    return beats(range(7, stop, period), 10)


def every(times: Iterable[float], make: object = compass, src: int = 21) -> list[Timed]:
    return [(t, make(k, src)) for k, t in enumerate(times)]  # type: ignore[operator]


def seen(*sent: Timed, steps: tuple[int, ...] = (7,)) -> list[Said]:
    return whole(log(*sent), RULES, steps)


def test_a_compass_that_never_comes_back() -> None:
    (one,) = seen(*others(12_000), *beats(range(0, 12_000, 1000)), *every(range(10, 4000, 100)))
    assert (one.rule, one.severity, one.node, one.type, one.count) == ("BUS-035", "warning", 21, COMPASS, 1)
    assert one.text == "nothing of it for 7.1 s, every 100 ms before, to the end"


def test_a_fix_that_is_away_for_some_time() -> None:
    times = [*range(10, 4000, 200), *range(14_810, 20_000, 200)]
    (one,) = seen(*others(20_000), *beats(range(0, 20_000, 1000)), *every(times, fix))
    assert (one.rule, one.node, one.type, one.count) == ("BUS-035", 21, FIX, 1)
    assert one.text == "nothing of it for 11.0 s, every 200 ms before"


@pytest.mark.parametrize("back", [(), range(9000, 15_000, 100)])
def test_a_node_that_falls_silent_with_all_its_types_is_one_finding(back: Iterable[int]) -> None:
    times = [*range(10, 4000, 100), *back]
    own = [*every(times), *every([t for t in times if not t % 200 or t % 200 == 10], fix)]
    status = beats(t for t in range(0, 15_000, 1000) if t < 4000 or (back and t >= 9000))
    (one,) = seen(*others(15_000), *own, *status)
    assert (one.rule, one.node, one.type, one.count) == ("BUS-035", 21, "", 1)
    assert one.text.startswith("nothing of the node for ")


def test_a_type_that_stopped_before_its_node_did_is_a_finding_of_its_own() -> None:
    times = range(10, 4000, 100)
    sent = (*every(times), *every(range(10, 9000, 200), fix), *beats(range(0, 9000, 1000)))
    found = seen(*others(20_000), *sent)
    assert [(one.rule, one.type, one.count) for one in found] == [("BUS-035", COMPASS, 1), ("BUS-035", "", 1)]


def test_a_silence_of_the_whole_bus_blames_nobody() -> None:
    times = [*range(10, 4000, 100), *range(9000, 12_000, 100)]
    status = [t for t in range(0, 12_000, 1000) if t < 4000 or t >= 9000]
    assert seen(*every(times), *beats(status), *beats((t + 7 for t in status), 10)) == []


def test_the_end_of_the_capture_within_five_periods_is_no_silence() -> None:
    for stop, count in ((4400, 0), (4800, 1)):
        sent = (*others(stop, 50), *every(range(10, 4000, 100)))
        assert sum(one.count for one in seen(*sent) if one.rule == "BUS-035") == count


def test_a_lower_rate_without_a_loss_is_no_silence() -> None:
    times = [*range(10, 4000, 100), *range(4900, 12_000, 1000), *range(12_000, 14_000, 100)]
    assert seen(*others(14_000), *beats(range(0, 14_000, 1000)), *every(times)) == []


@pytest.mark.sampled(3)
@pytest.mark.parametrize("seed", range(12))
def test_what_is_not_sent_at_a_pace_may_stop(seed: int) -> None:
    random, t, times = Random(seed), 0.0, []
    for _ in range(60):
        t += random.expovariate(1 / 250)
        times.append(t)
    stop = round(t) + 10_000
    assert seen(*others(stop), *beats(range(0, stop, 1000)), *every(times)) == []


def test_a_few_messages_in_a_row_are_no_pace() -> None:
    times = [t + 20 * k for t in (0, 3000, 14_000) for k in range(8)]
    assert seen(*others(30_000), *beats(range(0, 30_000, 1000)), *every(times)) == []


def test_lost_frames_may_be_why() -> None:
    times = [*range(10, 4000, 100), *range(5000, 8000, 100)]
    lines = log(*others(8000, 50), *every(times)).splitlines(keepends=True)
    assert [one.severity for one in whole("".join(lines), ("BUS-035",), (7,))] == ["warning"]
    at = next(k for k, line in enumerate(lines) if float(line[1:18]) > START / 10**9 + 4.5)
    lines.insert(at, DROP)
    assert [one.severity for one in whole("".join(lines), ("BUS-035",), (7,))] == ["note"]


def test_the_last_frame_is_shown_when_it_is_no_longer_among_the_recent_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recent, "KEPT", 64)
    lines = log(*others(12_000, 50), *beats(range(0, 12_000, 1000)), *every(range(10, 4000, 100))).splitlines(True)
    running = Engine()
    judge = Judge(running.registry)
    for at in range(0, len(lines), 10):
        for batch in [*running.feed("".join(lines[at : at + 10]).encode()), running.flush()]:
            judge.feed(batch)
    ((_, run),) = [one for one in judge.finish().runs if one[0].rule == "BUS-035"]
    (line,) = run.examples[0].lines
    assert line.split("#")[1] == compass(39).frames(0)[0].data.hex().upper()


def test_a_restart_is_told_by_the_uptime_alone() -> None:
    times = [*range(10, 4000, 100), *range(7000, 12_000, 100)]
    status = [*beats(range(0, 4000, 1000)), *((7000 + 1000 * k, alive(k, 21, k)) for k in range(5))]
    found = whole(log(*others(12_000, 50), *every(times), *status), ("BUS-021", "BUS-035"), (7,))
    assert [one.rule for one in found] == ["BUS-021"]


def test_messages_that_nobody_can_read_are_no_silence() -> None:
    sent = [frame for t, one in every(range(10, 4000, 200), fix) for frame in one.frames(START + t * MS)]
    for k in range(40):
        sent += fix(20 + k).frames(START + (4010 + 200 * k) * MS)[k % 2 : -1]
    sent += [frame for t, one in others(13_000) for frame in one.frames(START + t * MS)]
    sent.sort(key=lambda frame: frame.t)
    text = "".join(log_line(frame) + "\n" for frame in sent)
    assert whole(text, ("BUS-035",), (7,)) == []


def test_the_status_alone_is_told_by_its_own_rule() -> None:
    found = seen(*others(12_000), *beats(range(0, 5000, 1000)), *every(range(10, 12_000, 100)))
    assert [(one.rule, one.type) for one in found] == [("BUS-020", ALIVE)]


def test_a_tool_may_go() -> None:
    sent = [(t, alive(t // 1000, 127, t // 1000 % 32)) for t in range(0, 5000, 1000)]
    (one,) = seen(*others(20_000), *sent)
    assert (one.severity, one.type) == ("note", "")


def test_other_protocols_are_not_judged() -> None:
    ids = [(t, Transfer("message", 0xFEF1, 0x21, bytes(7), 0, 0)) for t in range(0, 5000, 100)]
    text = log(*others(12_000), *ids).replace("C0\n", "7D\n")
    assert whole(text, ("BUS-035",), (7,)) == []


def test_an_esc_is_told_once(tmp_path: Path) -> None:
    for dies in (False, True):
        vehicle = Vehicle()
        vehicle.commands(0, 9000, 0, period=50)
        vehicle.statuses(0, 4000, period=50)
        for k in range(4 if dies else 9):
            vehicle.send(1000 * k + 3, ALIVE, 11, node_status(1000 * k))
        path = tmp_path / "esc.log"
        path.write_text(vehicle.finish())
        found = analyzer.check(path, select=["BUS-025", "BUS-035", "BUS-020"]).findings
        assert [(one.rule, one.node) for one in found if one.severity != "note"] == [("BUS-025", 11)]


def escs(pause: int, *, of: tuple[int, ...] = (11,), lost: bool = False, period: int = 20) -> str:
    """Three ESCs at 50 Hz; some pause at 5 s, and then go on where they were, or as if they had not."""
    vehicle = Vehicle()
    commands = range(0, 9000, 10)
    for t in commands:
        if not (lost and 5000 <= t < 5000 + pause):
            vehicle.command(t, 0)
        else:
            vehicle.count(("RawCommand", 1, None))
    for node in (11, 12, 13):
        for t in range(node - 10, 9000, 20):
            away = node in of and 5000 <= t < 5000 + pause and (t - node + 10 - 5000) % period
            if not (node in of and 5000 <= t < 5000 + pause) or (period > 20 and not away):
                vehicle.status(t, node)
            elif lost:
                vehicle.count(("ESCStatus", node, None))
    return vehicle.finish()


def loud(text: str) -> list[tuple[str, int]]:
    rules = ("BUS-020", "BUS-025", "BUS-035")
    return [(one.rule, one.node) for one in whole(text, rules, (211,)) if one.severity != "note"]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("pause", [160, 500, 1900])
def test_a_fast_esc_that_is_away_for_less_than_two_seconds(pause: int) -> None:
    both = [("BUS-025", 11), ("BUS-035", 11)]
    assert loud(escs(pause)) == both
    assert loud(escs(pause, lost=True, of=(11, 12, 13))) == []  # the recorder's loss, or a silent bus
    assert loud(escs(pause, period=100)) == []  # a lower rate
    assert loud(escs(60)) == []


@pytest.mark.sampled(5)
@pytest.mark.parametrize("seed", range(5, 12))
def test_one_stamp_that_is_too_early_is_no_silence(seed: int) -> None:
    text, _, _ = flown("CAP-001", seed)
    assert whole(text, ("BUS-035",), (401,)) == []
