"""Events on plots, in the file: at the times and frames of the events, on the value that the report told."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from kit import CAPTURES
from kit.pictures import read_back

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


def test_marks_of_a_flight_are_its_events(command: Callable[..., tuple[int, str, str]], tmp_path: Path) -> None:
    capture, target = CAPTURES / "esc-failure.mcap", tmp_path / "flight.rrd"
    assert command("plot", capture, "-o", target, "--max-points", "all")[0] == 0
    told = json.loads(command("events", capture, "-T", "json")[1])
    drawn = read_back(target)
    entities = drawn.under("/events/")
    texts = [point for name in ("trouble", "calm") for point in drawn.rows[f"/events/{name}"]]
    assert sorted((times["time"], times["frame"]) for times, _ in texts) == sorted(
        (one["t_end_ns"], one["frame"]) for one in told["events"]
    )
    for quantity in ("voltage", "current", "temperature", "speed"):
        for ch in range(1, 5):
            wanted = [
                (one["t_end_ns"], one["values"][quantity])
                for one in told["events"] if one["ch"] == ch and quantity in one["values"]
            ]  # fmt: skip
            marks = [(times["time"], value) for times, value in drawn.points(f"/events/{quantity}/esc{ch}")]
            assert marks == wanted
            assert f"/events/{quantity}/esc{ch}" in entities or not wanted
    (begin, _), (end, state) = drawn.points("/flights")
    (flight,) = told["flights"]
    assert (begin["time"], end["time"], state) == (flight["t_ns"], flight["t_end_ns"], flight["end"])
