"""Events of stored batches: flights, events, what broke first; and statistics of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer.app.browse.tabs import flight_lines, statistic_lines, triage_lines
from analyzer.app.statistics import RunStatistics
from analyzer.app.triage import RunTriage
from analyzer.browser.supply import TabLine

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from analyzer.app.run import Run
    from analyzer.decode.engine import Batch


class Happened(NamedTuple):
    """First and last time of each flight, what is to be read at frames (from 0), and tabs by name."""

    flights: Sequence[tuple[int, int]]
    places: dict[int, str]
    tabs: Mapping[str, Sequence[TabLine]]


def happened(run: Run, batches: Iterable[Batch]) -> Happened:
    """Find flights, events and what broke first."""
    statistics, triage = RunStatistics(run, ["flights", "events"]), RunTriage(run)
    for _ in triage.over(statistics.over(batches)):
        pass
    flights, events = statistics.tables()
    places: dict[int, str] = {}
    for one in flights.records():
        places[one["frame"] - 1] = f"flight {one['flight']} begins"
        places[one["frame_end"] - 1] = f"flight {one['flight']} ends: {one['end']}"
    for one in events.records():
        if one["frame"] is not None:
            who = f"ch{one['ch']} " if one["ch"] else f"node {one['node']} " if one["node"] else ""
            before = places.get(one["frame"] - 1)
            said = f"{who}{one['kind']}: {one['text']}"
            places[one["frame"] - 1] = said if before is None else f"{before}; {said}"
    spans = [(one["t_ns"], one["t_end_ns"]) for one in flights.records()]
    tabs = {
        "flights": flight_lines(flights, statistics.start),
        "events": statistic_lines([events], statistics.start, statistics.end, len(run.engine.buses)),
        "triage": triage_lines(triage.found()),
    }
    return Happened([one for one in spans if None not in one], places, tabs)


def statistic(run: Run, text: str, batches: Iterable[Batch]) -> list[TabLine]:
    """Return the lines of a statistic, or why there is none."""
    try:
        statistics = RunStatistics(run, [text], run.request.rules.bit_rate)
        for _ in statistics.over(batches):
            pass
        return statistic_lines(statistics.tables(), statistics.start, statistics.end, len(run.engine.buses))
    except (LookupError, ValueError, OSError) as error:
        return [TabLine(line, "bad") for line in str(error).splitlines()]
