"""A bus for the browser: the session hands its batches on into the store, the display shows that."""

from __future__ import annotations

import threading
from dataclasses import replace
from queue import SimpleQueue
from typing import TYPE_CHECKING

from analyzer.app.browse.happened import happened, statistic
from analyzer.app.browse.session import BrowseOptions, made
from analyzer.app.browse.tabs import finding_line
from analyzer.browser.store.store import StoreFullError, TableStore
from analyzer.browser.supply import ONLY_ONCE, TABS, TabLine
from analyzer.stats.catalogue import named as known_statistic

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from analyzer.app.browse.live_names import LiveNames
    from analyzer.app.criteria import Criteria
    from analyzer.app.live.session import LiveSession
    from analyzer.app.run import Run
    from analyzer.decode.engine import Batch
    from analyzer.report.model import Finding
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Measured

_MOST_NOTES = 200
_MADE = ("events", "flights", "triage")  # tabs that are found out together


class LiveSupply:
    """Both ends of it: a view for the session, in its thread, and a supply for the browser.

    Args:
        criteria: types and labels.
        name: of the buses.
        folder: of the store.
        stop: ends the session.
        named: is told which frames rules name.
        recorded: the file that is recorded, empty if there is none to have marks beside it.
        options: how it is shown at first.
    """

    live = True
    asking = False
    doing = "ended"

    def __init__(
        self, criteria: Criteria, name: str, folder: Path, stop: Callable[[], None], named: LiveNames,
        recorded: str = "", options: BrowseOptions | None = None,
    ) -> None:  # fmt: skip
        self.store, self.registry, self.name = TableStore(folder), criteria.registry, name
        # What is written and drawn is read from the recording.
        self.paths: tuple[str, ...] = (recorded,) if recorded else ()
        self.arguments: tuple[str, ...] = ()
        self.window: tuple[str, ...] = ()
        self.notes: list[str] = []
        self.named, self.recorded = named, recorded
        self.flights: Sequence[tuple[int, int]] = ()
        self.places: dict[int, str] = {}
        self.troubles: Sequence[tuple[int, str]] = ()
        self.starts: Sequence[int] = ()
        self.labels, self._pages = criteria.labels, criteria.pages
        self.remarks: dict[int, str] = {}
        self.severities: dict[str, str] = {rule: page.severity for rule, page in criteria.pages.items()}
        self.ended = self.failed = False
        self._stop, self._full = stop, False
        self._options = options or BrowseOptions(marks=bool(recorded))
        self._findings: list[TabLine] = []
        self._tabs: dict[str, Sequence[TabLine]] = {}
        self._run: Run | None = None
        self._asked: SimpleQueue[str] = SimpleQueue()
        self._text = ""

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
        self.take([change.finding for change in changes if change.fresh])

    def take(self, findings: Sequence[Finding]) -> None:
        """Take findings, those of before among them."""
        buses = self._run.engine.buses if self._run is not None else self.store.buses
        for one in findings:
            line = finding_line(one, self.store.low)
            self._findings.insert(0, line)
            self.named.keep(one.rule, buses.index(one.bus) if one.bus in buses else -1, one.node)
            if one.first.t_ns is not None:
                self.troubles = [*self.troubles, (one.first.t_ns, one.severity)]
            if line.frame is not None and line.frame >= self.store.first:
                self.starts = sorted({*self.starts, line.frame})

    def note(self, text: str) -> None:
        """Take a note about the session."""
        self.notes = [*self.notes[-_MOST_NOTES:], text]

    def look(self, session: LiveSession) -> None:
        """Take how the session decodes: what happened is found in the same way. The browser looks by itself."""
        self._run = session.reading

    # ---- for the browser, in its thread

    @property
    def revision(self) -> int:
        """Count how often a finding has named rows."""
        return self.named.revision

    @property
    def loaded(self) -> bool:
        """True once no batch comes any more."""
        return self.ended or self._full

    @property
    def share(self) -> float:
        """Return 1: what there is is decoded."""
        return 1.0

    def tab(self, name: str) -> Sequence[TabLine] | None:
        """Return the findings so far; other tabs as they were when they were asked for."""
        if name == "findings":
            return self._findings or [TabLine("nothing is found so far", "good")]
        return self._tabs.get(name)

    def changed(self) -> str:
        """Return nothing: there is no file that was read."""
        return ""

    def only_once(self) -> str:
        """Return why it cannot be read anew."""
        return ONLY_ONCE

    def renew(self, name: str) -> None:
        """Find out what a tab has to show of all that came until now."""
        if name in _MADE:
            self._asked.put(name)
        elif name == "statistics" and self._text:
            self._asked.put(f" {self._text}")

    def ask(self, text: str) -> str:
        """Ask for a statistic of all that came until now; return what is wrong with it."""
        try:
            known_statistic(text)
        except ValueError as error:
            return str(error)
        self._tabs.pop("statistics", None)
        self.asking = True
        self._text = text
        return ""

    def explain(self, rule: str, width: int) -> str:
        """Return the page of a rule."""
        from analyzer.report.explain import render  # noqa: PLC0415 - few ask

        page = self._pages.get(rule)
        return "" if page is None else render(rule, page.body, width=width)

    def stop(self) -> None:
        """End the session."""
        self._asked.put("")
        self._stop()

    def run(self) -> None:
        """Show it until the session ends and the user quits. Raises whatever goes wrong."""
        from analyzer.views.colours.rules import colour_rules  # noqa: PLC0415 - as the display itself

        threading.Thread(target=self._work, name="happened", daemon=True).start()
        app = made(self, self._options, colour_rules(None, self.registry))
        app.following = True
        app.run()
        if app.return_code:
            self.failed = True

    # ---- in a thread of its own

    def _work(self) -> None:
        while asked := self._asked.get():
            while not self._asked.empty():  # a key may be pressed often
                asked = self._asked.get() or asked
            run = self._run
            if run is None or not self.store.segments:
                continue
            try:
                self._make(run, asked)
            except Exception as error:  # noqa: BLE001 - the bus goes on, and is shown
                self._tabs[asked.strip() if asked in TABS else "statistics"] = [TabLine(f"failed: {error}", "bad")]

    def _make(self, run: Run, asked: str) -> None:
        head = TabLine(
            f"of the {self.store.count:,} frames that came until this was asked for; the key again: anew", "dim"
        )
        if asked in _MADE:
            found = happened(run, self._stored())
            self.flights, self.places = found.flights, found.places
            self._tabs |= {name: [head, *lines] for name, lines in found.tabs.items()}
        else:
            self._tabs["statistics"] = [head, *statistic(run, asked.strip(), self._stored())]
            self.asking = False

    def _stored(self) -> Iterator[Batch]:
        return self.store.batches()
