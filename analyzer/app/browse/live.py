"""A bus for the browser: the session hands its batches on into the store, the display shows that."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from analyzer.app.browse.session import BrowseOptions, made
from analyzer.app.live.list import said
from analyzer.browser.store.store import Store, StoreFullError
from analyzer.browser.supply import TabLine

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from analyzer.app.criteria import Criteria
    from analyzer.app.live.session import LiveSession
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Measured
    from analyzer.rules.named_frames import NamedFrames

_MOST_NOTES = 200
_STYLES = {"error": "bad", "warning": "warn", "note": "dim"}


class LiveSupply:
    """Both ends of it: a view for the session, in its thread, and a supply for the browser.

    Args:
        criteria: types and labels.
        name: of the buses.
        folder: of the store.
        stop: ends the session.
    """

    live = True
    doing = "ended"

    def __init__(self, criteria: Criteria, name: str, folder: Path, stop: Callable[[], None]) -> None:
        self.store, self.registry, self.name = Store(folder), criteria.registry, name
        self.paths: tuple[str, ...] = ()
        self.arguments: tuple[str, ...] = ()
        self.notes: list[str] = []
        self.named: NamedFrames | None = None
        self.flights: Sequence[tuple[int, int]] = ()
        self.troubles: Sequence[tuple[int, str]] = ()
        self.starts: Sequence[int] = ()
        self.labels = criteria.labels
        self.severities: dict[str, str] = {rule: page.severity for rule, page in criteria.pages.items()}
        self.ended = self.failed = False
        self._stop, self._full = stop, False
        self._findings: list[TabLine] = []

    # ---- for the session, in its thread

    def batch(self, measured: Measured) -> None:
        """Store the next batch, as long as there is room."""
        if self._full:
            return
        try:
            self.store.add(replace(measured.batch, bit_times=measured.bits))
        except StoreFullError as error:
            self._full = True
            self.note(str(error))

    def found(self, changes: Sequence[Change]) -> None:
        """Take findings that are new or have come up again."""
        for one in (change.finding for change in changes if change.fresh):
            frame = None if one.first.frame is None else one.first.frame - 1
            chosen = "" if one.node is None else f"node == {one.node}"
            self._findings.insert(0, TabLine(said(one), _STYLES[one.severity], frame, one.first.t_ns, chosen))
            if one.first.t_ns is not None:
                self.troubles = [*self.troubles, (one.first.t_ns, one.severity)]
            if frame is not None:
                self.starts = sorted({*self.starts, frame})

    def note(self, text: str) -> None:
        """Take a note about the session."""
        self.notes = [*self.notes[-_MOST_NOTES:], text]

    def look(self, session: LiveSession) -> None:
        """Do nothing: the browser looks by itself."""

    # ---- for the browser, in its thread

    @property
    def loaded(self) -> bool:
        """True once no batch comes any more."""
        return self.ended or self._full

    @property
    def share(self) -> float:
        """Return 1: what there is is decoded."""
        return 1.0

    def tab(self, name: str) -> Sequence[TabLine] | None:
        """Return the findings so far; other tabs need an end."""
        if name == "findings":
            return self._findings or [TabLine("nothing is found so far", "good")]
        return [TabLine(f"{name} need a capture with an end: tailbyte view of the recording (-w FILE)", "dim")]

    def ask(self, statistic: str) -> str:
        """Return why there is no statistic."""
        return f"{statistic}: a bus has no end; tailbyte stats of its recording tells it (-w FILE)"

    def stop(self) -> None:
        """End the session."""
        self._stop()

    def run(self) -> None:
        """Show it until the session ends and the user quits. Raises whatever goes wrong."""
        from analyzer.views.colours.rules import colour_rules  # noqa: PLC0415 - as the display itself

        app = made(self, BrowseOptions(marks=False), colour_rules(None, self.registry))
        app.following = True
        app.run()
        if app.return_code:
            self.failed = True
