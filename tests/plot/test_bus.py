"""Load and rate of a bus, second by second, against a sum frame by frame with the simulator's own count of bits."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

import pytest
from kit.pictures import Drawn, draw
from kit.simulated import flown

from analyzer.simulate.bits import duration

if TYPE_CHECKING:
    from dissectors.traffic import SimulatedFrame

SECOND = 1_000_000_000
BIT = 1000  # ns, at 1 Mbit/s


def seconds(frames: list[SimulatedFrame], start: int) -> dict[int, tuple[int, int]]:
    """Frames and bits by second from `start`."""
    out: dict[int, list[SimulatedFrame]] = defaultdict(list)
    for frame in frames:
        out[(frame.t - start) // SECOND].append(frame)
    return {k: (len(some), sum(duration(one, BIT) for one in some) // BIT) for k, some in out.items()}


def course(drawn: Drawn, entity: str) -> dict[int, float]:
    return {times["since_start"]: value for times, value in drawn.points(entity)}


@pytest.mark.slow
def test_frames_and_bits_of_every_second() -> None:
    flight = flown(6, escs=4)
    drawn, _ = draw(flight.text)
    wanted = seconds(flight.frames, flight.frames[0].t)
    assert course(drawn, "/frame_rate/can0") == {k * SECOND: float(count) for k, (count, _) in wanted.items()}
    load = course(drawn, "/bus_load/can0")
    assert load == pytest.approx({k * SECOND: 100 * bits / 1e6 for k, (_, bits) in wanted.items()}, rel=0.01)


@pytest.mark.slow
def test_cuts_inside_a_second_do_not_show() -> None:
    text = flown(6, escs=4).text
    whole, cut = draw(text)[0], draw(text, size=3333)[0]
    for entity in ("/frame_rate/can0", "/bus_load/can0"):
        assert cut.points(entity) == whole.points(entity)


def test_silence_is_a_rate_of_nothing() -> None:
    lines = flown(6, escs=1).text.splitlines(keepends=True)
    start = float(lines[0][1:].partition(")")[0])
    kept = [line for line in lines if not 2 <= float(line[1:].partition(")")[0]) - start < 5]
    rates = course(draw("".join(kept))[0], "/frame_rate/can0")
    assert [rates[k * SECOND] > 0 for k in (0, 1, 5)] == [True] * 3
    assert rates[2 * SECOND] == 0.0
    assert 3 * SECOND not in rates  # a line between two zeros is zero
    assert rates[4 * SECOND] == 0.0
    assert sum(rates.values()) == len(kept)


@pytest.mark.slow
def test_limits_are_lines_from_end_to_end() -> None:
    drawn, picture = draw(flown(6, escs=2).text)
    points = drawn.points("/frame_rate/limit/4000")
    rate = drawn.points("/frame_rate/can0")
    assert [value for _, value in points] == [4000.0, 4000.0]
    assert [times["time"] for times, _ in points] == [rate[0][0]["time"], rate[-1][0]["time"]]
    assert picture.inventory.series["/frame_rate/limit/4000"].role == "limit"
