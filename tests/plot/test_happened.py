"""Events on plots, in the file: at the times and frames of the events, on the value that the report told."""

from __future__ import annotations

import json
import re
from operator import attrgetter
from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES
from kit.pictures import read_back

from analyzer.app.marks import EventMarks
from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.flight.finder import EventFinder

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dissectors import Registry


@pytest.mark.slow
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
    marks = {
        entity: {(times["time"], round(value, 3)) for times, value in drawn.points(entity)}
        for entity in entities if entity.removeprefix("/events/") not in ("trouble", "calm")
    }  # fmt: skip
    for one in told["events"]:
        at = {entity for entity, points in marks.items() if one["t_end_ns"] in dict(points)}
        assert at, one  # every event is marked somewhere: on its channel, on what it commands, or on its bus
        if one["ch"] is not None:
            assert at & {f"/events/speed/esc{one['ch']}", f"/events/calm/speed/esc{one['ch']}"}
        for quantity in ("voltage", "current", "temperature", "speed"):
            if one["ch"] is not None and quantity in one["values"] and one["kind"] in ("fault", "mode"):
                mark = one["t_end_ns"], one["values"][quantity]
                assert any(mark in marks[entity] for entity in at if entity.endswith(f"/{quantity}/esc{one['ch']}"))
    (begin, _), (end, state) = drawn.points("/flights")
    (flight,) = told["flights"]
    assert (begin["time"], end["time"], state) == (flight["t_ns"], flight["t_end_ns"], flight["end"])


@pytest.mark.slow
def test_events_without_a_line_of_their_own_are_on_the_bus(
    command: Callable[..., tuple[int, str, str]], tmp_path: Path
) -> None:
    capture, target = CAPTURES / "bus-break.log", tmp_path / "flight.rrd"
    assert command("plot", capture, "-o", target)[0] == 0
    told = json.loads(command("events", capture, "-T", "json")[1])["events"]
    drawn = read_back(target)
    on_bus = {times["time"]: value for times, value in drawn.points("/events/bus_load/can0")}
    wanted = {one["t_end_ns"] for one in told if one["kind"] in ("errors", "bus state", "gap")}
    assert wanted <= set(on_bus)
    loads = set(drawn.values("/bus_load/can0"))
    assert set(on_bus.values()) <= loads


@pytest.mark.slow
def test_commands_are_marked_where_they_were(command: Callable[..., tuple[int, str, str]], tmp_path: Path) -> None:
    capture, target = CAPTURES / "control-lost.log", tmp_path / "flight.rrd"
    assert command("plot", capture, "-o", target, "--max-points", "all")[0] == 0
    told = json.loads(command("events", capture, "-T", "json")[1])["events"]
    drawn = read_back(target)
    (spread,) = [one for one in told if one["kind"] == "spread"]
    marked = {
        entity: {times["time"]: value for times, value in drawn.points(entity)}
        for entity in drawn.under("/events/throttle/commanded/")
    }
    (at,) = [entity for entity, points in marked.items() if spread["t_end_ns"] in points]
    line = {times["time"]: value for times, value in drawn.points(at.removeprefix("/events"))}
    assert marked[at][spread["t_end_ns"]] == pytest.approx(line[spread["t_end_ns"]], abs=12)  # a step of 25 ms


def test_a_live_session_marks_what_a_plot_marks(registry: Registry) -> None:
    """Events come as they are told, and none twice; a plot of the recording has the same marks."""
    capture = CAPTURES / "esc-failure.mcap"
    run = Run(Request((str(capture),)))
    marks, told = EventMarks(registry), []
    for batch in run.batches():
        marks.feed(batch)
        told += marks.fresh()
    last = marks.finish()
    told += last.events
    whole = EventFinder(registry)
    for batch in Run(Request((str(capture),))).batches():
        whole.feed(batch)
    assert len({id(one) for one, _ in told}) == len(told)
    key = attrgetter("first", "kind", "text")
    assert sorted((key(one) for one, _ in told), key=str) == sorted(map(key, whole.events()), key=str)
    assert all(values for one, values in told if one.ch is not None)


@pytest.mark.slow
def test_logs_begin_with_their_whole_time(command: Callable[..., tuple[int, str, str]], tmp_path: Path) -> None:
    target = tmp_path / "flight.rrd"
    assert command("plot", CAPTURES / "esc-failure.mcap", "-o", target)[0] == 0
    drawn = read_back(target)
    for entity in ("/events/trouble", "/events/calm", "/findings/error", "/findings/warning"):
        texts = [text for _, parts in drawn.rows[entity] for text in parts["TextLog:text"]]
        assert texts
        assert all(re.match(r"08:02:\d\d\.\d{3} \S", text) for text in texts)
