"""A live session in Rerun's viewer, which may be slow, hung or gone: the session never waits for it."""

from __future__ import annotations

import os
import time
from typing import TYPE_CHECKING

from analyzer.app.marks import EventMarks
from analyzer.plot import LOG_LEVEL
from analyzer.plot.address import Address
from analyzer.plot.parts import whole
from analyzer.plot.picture import Picture
from analyzer.plot.viewer import ViewerOutput
from analyzer.sinks.atomic import TargetError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from contextlib import ExitStack

    from analyzer.app.criteria import Criteria
    from analyzer.app.live.session import LiveSession
    from analyzer.facts.summary import Facts
    from analyzer.report.model import Report
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Measured

# Seconds between two layouts at least, while more and more appears on the bus.
_LAYOUT = 2.0


def opened(url: str, name: str, stack: ExitStack) -> ViewerOutput:
    """Open the viewer at an address, or a new one. Raises `TargetError`."""
    from analyzer.plot import viewer_program as viewer  # noqa: PLC0415 - an address needs none

    os.environ.setdefault(LOG_LEVEL, "off")  # what it has to complain of would stand in the middle of the monitor
    if not url:
        if not viewer.display():
            raise TargetError("--plot", "there is no display for a viewer: give the URL of one")
        try:
            url = str(viewer.window())
        except viewer.NoViewerError as error:
            raise TargetError("--plot", str(error)) from None
    try:
        address = Address.parse(url)
    except ValueError as error:
        raise TargetError("--plot", str(error)) from None
    return stack.enter_context(ViewerOutput(address, name, waits=False))


class LivePlot:
    """Feeds a viewer.

    Args:
        output: does not wait.
        criteria: types and settings.
        tell: takes what there is to say of the viewer.
        several: whether the names of interfaces say anything.
        now: seconds of a monotonic clock.
    """

    def __init__(
        self,
        output: ViewerOutput,
        criteria: Criteria,
        tell: Callable[..., None],
        *,
        several: bool,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self.failed = False
        settings = criteria.settings
        self._output, self._tell, self._several, self._now = output, tell, several, now
        self._picture = Picture(output.send, criteria.registry, bit_rate=settings.bit_rate)
        self._marks = EventMarks(criteria.registry)
        self._buses: tuple[str, ...] = ()
        self._shown = 0
        self._laid = -_LAYOUT
        self._problem: str | None = None

    def batch(self, measured: Measured) -> None:
        """Draw what is in it, at once."""
        if self._problem is None:
            self._picture.note_start(measured.batch)
            self._marks.feed(measured.batch)
            self._buses = measured.batch.buses
            self._picture.feed(whole(measured.batch), measured.bits)
            self._picture.take_events(self._marks.fresh(), self._buses)

    def found(self, changes: Sequence[Change]) -> None:
        """Draw findings, as they begin."""
        if self._problem is None:
            self._picture.take_findings((one.finding for one in changes if one.fresh), several=self._several)

    def note(self, text: str) -> None:
        """Do nothing."""

    def look(self, session: LiveSession) -> None:
        """Lay out what has come up since, and notice a viewer that is gone."""
        del session
        if self._problem is None and self._output.problem is not None:
            self._problem = self._output.problem
            self._tell(f"the viewer gets no more: {self._problem}")
        found = len(self._picture.inventory.series)
        if self._problem is None and found != self._shown and self._now() - self._laid >= _LAYOUT:
            self._shown, self._laid = found, self._now()
            self._output.layout(self._picture.layout())

    def end(self, report: Report, facts: Facts) -> None:
        """Draw the verdict and the summary."""
        if self._problem is None:
            found = self._marks.finish()
            self._picture.take_events(found.events, self._buses)
            self._picture.take_flights(found.flights)
            self._picture.finish(report, facts)
            self._output.layout(self._picture.layout())
        if self._output.dropped:
            self._tell(f"the viewer did not get {self._output.dropped:,} points")
