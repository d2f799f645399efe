"""A flight as a window: its frames are found in a first reading of the captures."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from analyzer.flight.flights import FlightFinder
from analyzer.sources import CaptureError
from analyzer.window.numbering import Numbering
from dissectors.records import replace

if TYPE_CHECKING:
    from analyzer.app.run import Run

LAST = -1


def narrow(run: Run) -> str | None:
    """Narrow the window of a run that is not read yet to the flight it asks for; return why that cannot be.

    What is damaged is complained of by who reads the run.
    """
    request, name = run.request, run.source.name
    before = None if request.follow else run.before()
    names = [part.origin for part in run.source.parts if isinstance(part.origin, str) and part.origin != "-"]
    if not all(map(os.path.lexists, names)):
        return None
    if before is None or request.flight is None:
        return f"{name}: --flight reads the capture twice, this exists only once: save it to a file first"
    damaged = False
    finder, numbering = FlightFinder(run.registry), Numbering(wireshark=request.wireshark)
    try:
        for batch in before.batches():
            finder.feed(batch)
            numbering.feed(batch.first_frame, batch.frames, batch.events)
    except CaptureError:
        damaged = True
    flights = finder.finish().select(["frame", "frame_end"]).to_pylist()
    number = len(flights) if request.flight == LAST else request.flight
    if not 1 <= number <= len(flights):
        wanted = "no flight" if request.flight == LAST else f"no flight {request.flight}"
        there = f"it has {len(flights)}" if flights else "motors never turned for long enough"
        hint = " (it is damaged: tailbyte info says how)" if damaged or before.state == "damaged" else ""
        return f"{name}: {wanted}: {there}{hint}"
    low, high = (numbering.of(flights[number - 1][key]) for key in ("frame", "frame_end"))
    if request.window.frames is not None:
        low, high = max(low, request.window.frames[0]), min(high, request.window.frames[1])
    run.request = replace(request, window=replace(request.window, frames=(low, high)), flight=None)
    return None
