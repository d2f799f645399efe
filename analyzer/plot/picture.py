"""The picture of a capture: parts of it in, chunks out. Nothing but findings and the summary waits for the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.plot import broken, findings, summary
from analyzer.plot.bus import BusPlots
from analyzer.plot.canvas import Canvas
from analyzer.plot.chunks import path
from analyzer.plot.happened import HappenedPlots
from analyzer.plot.inventory import Series
from analyzer.plot.layout.whole import layout
from analyzer.plot.messages import MessagePlots
from analyzer.plot.moments import NO_FRAME, PlotClock, times
from analyzer.report import wording
from analyzer.window.first_frames import first_frames
from dissectors.kit import NO_TIME, FrameTable

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence

    import pyarrow as pa
    from rerun.blueprint import Blueprint
    from rerun.chunk import Chunk

    from analyzer.decode.engine import Batch
    from analyzer.facts.summary import Facts
    from analyzer.plot.happened import MarkedEvent
    from analyzer.plot.inventory import Inventory
    from analyzer.plot.thinning import Thinning
    from analyzer.report.model import Finding, Report
    from analyzer.window.part import BatchPart
    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.picture import Pictures

SUMMARY = "summary"


class Picture:
    """One capture.

    Args:
        send: takes chunks as they are made.
        registry: the types that the capture is decoded with. Raises `ProfileError` for a wrong `plots.toml`.
        bit_rate: of the bus, in bits a second.
        most: points of a line at most; None shows all.
    """

    def __init__(
        self,
        send: Callable[[Sequence[Chunk]], None],
        registry: Registry,
        *,
        bit_rate: int | None = None,
        most: int | None = None,
    ) -> None:
        self._canvas = Canvas(send, most)
        self._messages = MessagePlots(self._canvas, registry, waiting=most is not None)
        self._buses = BusPlots(self._canvas, bit_rate)
        self._happened = HappenedPlots(self._canvas, self._messages.pictures, self._buses.load)
        self._from, self._to = NO_TIME, NO_TIME
        self._first = self._last = 0
        self._told: set[Hashable] = set()

    @property
    def inventory(self) -> Inventory:
        """The content of the recording so far."""
        return self._canvas.inventory

    @property
    def pictures(self) -> Pictures:
        """The quantities that have names."""
        return self._messages.pictures

    def thinned(self) -> Mapping[str, Thinning]:
        """Return what became of the lines that lost any points, by path; at the end."""
        return self._canvas.thinned()

    def note_start(self, batch: Batch) -> None:
        """Take a batch of the capture, whether it is shown or not: time counts from the first frame that has one."""
        if self._canvas.clock.start is None:
            t = times(batch.frames.column("t"))
            timed = np.flatnonzero(t != NO_TIME)
            if len(timed):
                self._canvas.begin(PlotClock(int(t[timed[0]])))

    def feed(self, part: BatchPart, bits: Array | None = None) -> None:
        """Draw what of the next batch is to be shown; `bits` are the `bit_times` of its frames if they are known."""
        leads = _leads(part.transfers)
        rows = part.transfer_rows
        whole = not len(rows) or int(rows[-1]) - int(rows[0]) + 1 == len(rows)

        def lead(transfers: Array) -> Array:
            at = transfers - rows[0] if whole else np.searchsorted(rows, transfers)
            found: Array = leads[at.astype(np.int64)]
            return found

        self._messages.feed(part.messages, lead, part.buses)
        broken.draw(self._canvas, part.transfers, leads)
        frames = FrameTable(part.frames)
        self._buses.feed(frames, part.frame_rows, self._canvas.clock.start, part.buses, bits)
        self._note_span(frames, part.frame_rows)
        self._canvas.flush()

    def take_findings(self, found: Iterable[Finding], *, several: bool) -> None:
        """Draw findings that have not been told yet; `several` says that there are buses to tell apart."""
        new = {_name(one): one for one in found if _name(one) not in self._told}
        self._told |= new.keys()
        findings.draw(self._canvas, new.values(), several=several)
        self._canvas.flush()

    def take_events(self, events: Sequence[MarkedEvent], buses: Sequence[str]) -> None:
        """Draw events that have not been told yet, in the part that is shown; before it is closed."""
        if events and self._from != NO_TIME:
            self._messages.finish()
            self._happened.events(events, buses, (self._from, self._to))
            self._canvas.flush()

    def take_flights(self, flights: pa.Table) -> None:
        """Draw when the vehicle flew, `FLIGHTS`, once that is known."""
        if self._from != NO_TIME:
            self._happened.flights(flights, (self._from, self._to))
            self._canvas.flush()

    def close(self, limits: Mapping[str, float]) -> None:
        """End the capture: draw what was held back. `limits` are frames a second by what they hold for."""
        self._messages.finish()
        self._buses.finish(limits)
        self._canvas.finish()
        self._canvas.flush()

    def finish(self, report: Report, facts: Facts, window: str = "") -> None:
        """End the capture with all there is to say of it. `window` says in words what is shown."""
        limits = {name: limit for one in report.captures for bus in one.buses for name, limit in bus.limits.items()}
        self.close(limits)
        inside = [one for one in report.findings if not window or self._inside(one)]
        self.take_findings(inside, several=wording.several_buses(report))
        text = summary.page(report, facts, self.inventory, self.thinned(), window)
        self._canvas.page(Series(path(SUMMARY), "text", SUMMARY, "Summary", owner=SUMMARY), text)
        self._canvas.flush()

    def layout(self) -> Blueprint:
        """Return how a viewer is to show what there is so far."""
        return layout(self.inventory, self.pictures, self._canvas.clock)

    def _note_span(self, frames: FrameTable, places: Array) -> None:
        if not len(frames):
            return
        timed = frames.t[frames.t != NO_TIME]
        if len(timed):
            low, high = int(timed.min()), int(timed.max())
            self._from = low if self._from == NO_TIME else min(self._from, low)
            self._to = max(self._to, high)
        self._first = self._first or int(places[0]) + 1
        self._last = int(places[-1]) + 1

    def _inside(self, one: Finding) -> bool:
        """Return True if something of a finding is in the part that is shown."""
        first, last = one.first, one.last
        if first.t_ns is not None and last.t_ns is not None and self._from != NO_TIME:
            return first.t_ns <= self._to and last.t_ns >= self._from
        return first.frame is not None and first.frame <= self._last and (last.frame or first.frame) >= self._first


def _name(one: Finding) -> Hashable:
    """Return what keeps a finding apart from all others, however it grows."""
    return (one.rule, one.severity, one.bus, one.node, one.type, one.key, one.first)


def _leads(transfers: pa.RecordBatch) -> Array:
    """Return the numbers of the first frames of transfers, from 1."""
    first = first_frames(transfers)
    found: Array = np.where(first < 0, NO_FRAME, first + 1)
    return found
