"""Flights: by what they are told, where they begin and end, and what is none."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from kit import CAPTURES
from kit.strategies import examples
from kit.traffic import START, TURNING, capture

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from kit.traffic import Planned

    Told = Callable[..., tuple[list[dict[str, Any]], list[dict[str, Any]]]]

MS = 1_000_000
PERIOD = 40
ARMING = "uavcan.equipment.safety.ArmingStatus"
ALIVE = "uavcan.protocol.NodeStatus"
WELL = dict.fromkeys(("health", "mode", "sub_mode", "vendor_specific_status_code"), 0)


def reports(start: int, stop: int, rpm: int = 3000, index: int = 0, **more: Any) -> Iterator[Planned]:
    """Reports of an ESC from `start` to before `stop`, in ms."""
    for t in range(start, stop, PERIOD):
        yield t + index, 11 + index, "ESCStatus", TURNING | {"rpm": rpm, "esc_index": index} | more


def commands(start: int, stop: int, *cmd: int) -> Iterator[Planned]:
    yield from ((t + 5, 1, "RawCommand", {"cmd": list(cmd)}) for t in range(start, stop, 10))


def alive(start: int, stop: int, node: int = 1, up: int = 100) -> Iterator[Planned]:
    for t in range(start, stop, 500):
        yield t + 7, node, ALIVE, WELL | {"uptime_sec": up + t // 1000}


def text(*parts: Iterator[Planned]) -> str:
    return capture(sorted((one for part in parts for one in part), key=lambda one: one[0]))


def short(flights: list[dict[str, Any]]) -> list[tuple[int, int, str, list[int], str]]:
    """Flights, in ms from the start."""
    return [
        ((one["t"] - START) // MS, (one["t_end"] - START) // MS, one["end"], one["chs"], one["by"]) for one in flights
    ]


def test_it_landed(told: Told) -> None:
    log = text(reports(0, 1000, 0), reports(1000, 3000), reports(3000, 4000, 0))
    assert short(told(log.encode())[0]) == [(1000, 2960, "landed", [1], "telemetry")]


def test_the_capture_ends_first(told: Told) -> None:
    log = text(reports(0, 1000, 0), reports(1000, 3000), alive(0, 3000))
    flights = told(log.encode())[0]
    assert short(flights) == [(1000, 2960, "cut", [1], "telemetry")]
    assert flights[0]["frame_end"] == len(log.splitlines()) - 1


def test_telemetry_ends_and_others_go_on(told: Told) -> None:
    log = text(reports(0, 2000), reports(0, 1800, index=1), alive(0, 4000), commands(0, 4000, 4000, 4000))
    assert short(told(log.encode())[0]) == [(0, 1960, "lost", [1, 2], "telemetry")]


@pytest.mark.parametrize(("stop", "found"), [(1360, 0), (1400, 1)])
def test_a_turn_of_a_moment_is_none(stop: int, found: int, told: Told) -> None:
    """Reports are 40 ms apart: 280 ms from the first to the last are none, 320 ms are one."""
    log = text(reports(0, 1000, 0), reports(1000, stop - 40), reports(stop - 40, 4000, 0))
    assert len(told(log.encode())[0]) == found


@pytest.mark.parametrize(("rpm", "found"), [(500, 0), (-500, 0), (501, 1), (-501, 1)])
def test_idle_is_none(rpm: int, found: int, told: Told) -> None:
    log = text(reports(0, 1000, 0), reports(1000, 3000, rpm), reports(3000, 4000, 0))
    assert len(told(log.encode())[0]) == found


@pytest.mark.parametrize(("pause", "found"), [(1960, 1), (2200, 2)])
def test_motors_that_stop_for_a_moment_go_on_flying(pause: int, found: int, told: Told) -> None:
    again = 2000 + pause
    log = text(reports(0, 2000), reports(2000, again, 0), reports(again, again + 1000), alive(0, again + 1000))
    assert len(told(log.encode())[0]) == found


def test_one_motor_is_enough(told: Told) -> None:
    log = text(reports(0, 1000), reports(1000, 4000, 0), reports(500, 3000, index=1), reports(3000, 4000, 0, index=1))
    assert short(told(log.encode())[0]) == [(0, 2981, "landed", [1, 2], "telemetry")]


def test_commands_tell_it_where_no_esc_does(told: Told) -> None:
    log = text(commands(0, 1000, 0, 0), commands(1000, 3000, 0, 500), commands(3000, 3500, 0, 0))
    assert short(told(log.encode())[0]) == [(1005, 2995, "landed", [2], "commands")]


def test_commands_say_nothing_where_an_esc_does(told: Told) -> None:
    log = text(commands(0, 3000, 500), reports(0, 3000, 0))
    assert told(log.encode())[0] == []


def test_arming_tells_it_where_nobody_else_does(told: Told) -> None:
    armed = [(t, 10, ARMING, {"status": 255 * (2000 <= t < 9000)}) for t in range(0, 12000, 1000)]
    log = text(iter(armed), alive(0, 12000))
    assert short(told(log.encode())[0]) == [(2000, 8000, "landed", [], "arming")]


def moved(log: str, since: int, by: float, *, without: float = 0) -> str:
    """Move the times from `since` ms on by `by` s; what is `without` seconds behind it is left out."""
    lines = []
    for line in log.splitlines():
        t, rest = float(line[1:18]), line[18:]
        start = START / 1e9 + since / 1000
        if start <= t < start + without:
            continue
        lines.append(f"({t + by * (t >= start):.6f}{rest}\n")
    return "".join(lines)


@pytest.mark.parametrize("by", [-7213.0, 7213.0, -0.5])
def test_a_clock_that_steps_makes_no_second_flight(by: float, told: Told) -> None:
    log = text(reports(0, 1000, 0), reports(1000, 5000), reports(5000, 6000, 0), alive(0, 6000), commands(0, 6000, 9))
    flights = told(moved(log, 3000, by).encode())[0]
    assert [(one["end"], one["frame"]) for one in flights] == [("landed", told(log.encode())[0][0]["frame"])]


def test_frames_that_the_recorder_lost_make_no_second_flight(told: Told) -> None:
    log = text(reports(0, 9000), alive(0, 9000), commands(0, 9000, 4000))
    assert len(told(moved(log, 3000, 0, without=3.0).encode())[0]) == 1


def test_a_long_hole_may_hide_a_landing(told: Told) -> None:
    log = text(reports(0, 75_000), alive(0, 75_000))
    flights = told(moved(log, 3000, 0, without=70.01).encode())[0]
    assert [one["end"] for one in flights] == ["lost", "cut"]


def test_the_hole_that_is_not_long_enough(told: Told) -> None:
    log = text(reports(0, 75_000), alive(0, 75_000))
    assert len(told(moved(log, 3000, 0, without=50.01).encode())[0]) == 1


def test_captures(told: Told) -> None:
    """By their keys: each of these hovers from about 1 s on, and none of them lands but for want of commands."""
    ends = {
        "hover-4": "cut", "bus-break": "cut", "command-loss": "landed", "pack-sag": "cut", "recording-ends": "cut",
        "hobbywing": "cut",
    }  # fmt: skip
    for name, end in ends.items():
        (one,) = told((CAPTURES / f"{name}.log").read_bytes())[0]
        assert (one["end"], one["by"]) == (end, "telemetry"), name
    for name in ("startup", "services", "dialects"):
        path = next(CAPTURES.glob(f"{name}.[lt]*"))
        assert told(path.read_bytes())[0] == [], name


def by_hand(rpms: list[list[int]]) -> list[tuple[int, int]]:
    """Flights of ESCs that report every 40 ms, from the definition: a slow second opinion, in reports."""
    turning: set[int] = set()
    for one in rpms:
        run: list[int] = []
        for k, rpm in enumerate([*one, 0]):
            if abs(rpm) > 500 and k < len(one):
                run.append(k)
            else:
                # What the end of the recording cuts off may have turned since the report before.
                since = run[0] - (k == len(one) and run[0] > 0) if run else 0
                if run and (run[-1] - since) * PERIOD > 300:
                    turning |= set(run)
                run = []
    found: list[tuple[int, int]] = []
    for k in sorted(turning):
        if found and (k - found[-1][1]) * PERIOD <= 2000:
            found[-1] = found[-1][0], k
        else:
            found.append((k, k))
    return found


PHASES = st.lists(st.tuples(st.sampled_from([0, 400, 3000]), st.integers(1, 60)), min_size=1, max_size=4)


@examples(50)
@given(phases=st.lists(PHASES, min_size=1, max_size=2), cuts=st.lists(st.integers(0, 1 << 20), max_size=4))
@example(phases=[[(0, 1), (3000, 8)]], cuts=[])
@example(phases=[[(3000, 9), (0, 50), (3000, 20)]], cuts=[])
@example(phases=[[(3000, 9), (0, 49), (3000, 20)]], cuts=[])
def test_law_flights_are_those_of_the_definition(
    told: Told, flush: object, phases: list[list[tuple[int, int]]], cuts: list[int]
) -> None:
    rpms = [[rpm for rpm, count in one for _ in range(count)] for one in phases]
    longest = max(map(len, rpms))
    rpms = [[*one, *[0] * (longest - len(one))] for one in rpms]
    planned = [
        (k * PERIOD, 11 + n, "ESCStatus", TURNING | {"rpm": one[k], "esc_index": n})
        for k in range(longest)
        for n, one in enumerate(rpms)
    ]
    log = capture(planned).encode()
    bounds = sorted({0, len(log), *(cut % (len(log) + 1) for cut in cuts)})
    pieces = [part for a, b in pairwise(bounds) for part in (log[a:b], flush)]
    flights = told(*pieces)[0]
    assert [((one["t"] - START) // (PERIOD * MS), (one["t_end"] - START) // (PERIOD * MS)) for one in flights] == (
        by_hand(rpms)
    )
    assert flights == told(log)[0]
