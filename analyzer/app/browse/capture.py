"""Captures for the browser: one thread decodes them into the store, then judges them and looks for what happened."""

from __future__ import annotations

import gc
import threading
from queue import SimpleQueue
from typing import TYPE_CHECKING

from analyzer.app.browse.stamps import FileStamps
from analyzer.app.run import Run
from analyzer.browser.store.store import StoreFullError, TableStore
from analyzer.browser.supply import ONLY_ONCE
from analyzer.facts.frame_comments import FrameComments
from analyzer.sources import CaptureError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from analyzer.app.criteria import Criteria
    from analyzer.app.request import Request
    from analyzer.browser.supply import TabLine
    from analyzer.decode.engine import Batch
    from analyzer.report.model import Report
    from analyzer.rules.named_frames import NamedFrames

_MOST_NOTES = 200


class CaptureSupply:
    """Decodes and judges captures for a browser, as `analyzer.browser.supply.Supply` has it.

    Args:
        request: what is asked.
        folder: of the store.

    Raises `DsdlError`, `ProfileError`, `CaptureError` and `OSError` for what cannot be opened, `ValueError` for a wrong
    vehicle file.
    """

    live, recorded = False, ""
    asking, revision = False, 0
    failed = refused = False  # something could not be read, decoded, stored or judged; it was not there to be asked for

    def __init__(self, request: Request, folder: Path) -> None:
        self.notes: list[str] = []
        self._run = Run(request, self._note)
        self._run.engine.core.measured = True
        self.store, self.registry = TableStore(folder), self._run.registry
        self.name, self.paths = self._run.source.name, request.names
        self.arguments = request.arguments
        self.window = tuple(word for words in request.window_words for word in words.split(" ", maxsplit=1))
        self.loaded, self.doing = False, "following" if request.follow else "decoding"
        self.named: NamedFrames | None = None
        self.flights: Sequence[tuple[int, int]] = ()
        self.troubles: Sequence[tuple[int, str]] = ()
        self.starts: Sequence[int] = ()
        self.places: dict[int, str] = {}
        self.labels: dict[int, str] = {}
        self.severities: dict[str, str] = {}
        self._comments = FrameComments()
        self.remarks = self._comments.texts
        self._criteria: Criteria | None = self._judging() if request.rules.vehicle is not None else None
        self.report: Report | None = None
        self._tabs: dict[str, Sequence[TabLine]] = {}
        self._asked: SimpleQueue[str] = SimpleQueue()
        self._stamps = FileStamps(request.names)
        self._stopped = False
        self._begun = threading.Event()
        self._thread = threading.Thread(target=self._work, name="decode", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End as soon as the batch at hand is done."""
        self._stopped = True
        self._run.stopped = True
        self._asked.put("")

    def join(self) -> None:
        """Wait for the end after `stop`."""
        self._thread.join(5)

    def opens(self, seconds: float) -> bool:
        """Return whether there is anything to see, as far as that is known after so long."""
        self._begun.wait(seconds)
        return bool(len(self.store)) or not (self.failed and self.loaded)

    @property
    def share(self) -> float:
        """How much is decoded, as far as that is known."""
        if self.loaded:
            return 1.0
        length = self._run.source.length
        most = 1.0 if self._run.request.follow else 0.99
        return min(most, self._run.source.size / length) if length else 0.0

    def tab(self, name: str) -> Sequence[TabLine] | None:
        """Return what a tab shows."""
        return self._tabs.get(name)

    def changed(self) -> str:
        """Return what has become of the files since they were read, once; empty for nothing."""
        return self._stamps.changed() if self.loaded else ""

    def only_once(self) -> str:
        """Return why it cannot be read anew, empty if it can."""
        return ONLY_ONCE if "-" in self.paths else self._stamps.gone()

    def renew(self, name: str) -> None:
        """Do nothing: what a tab shows is of all that there is."""

    def ask(self, text: str) -> str:
        """Ask for a statistic; return what is wrong with it."""
        from analyzer.stats.catalogue import named  # noqa: PLC0415 - few ask

        try:
            named(text)
        except ValueError as error:
            return str(error)
        self._tabs.pop("statistics", None)
        self.asking = True
        self._asked.put(text)
        return ""

    def explain(self, rule: str, width: int) -> str:
        """Return the page of a rule."""
        from analyzer.report.explain import render  # noqa: PLC0415 - few ask

        page = None if self._criteria is None else self._criteria.pages.get(rule)
        return "" if page is None else render(rule, page.body, width=width)

    # ---- in the thread

    def _work(self) -> None:
        try:
            self._decode()
            self.loaded = True
            self._begun.set()
            if self.store.segments and not self._stopped:
                for step in (self._happened, self._judge):
                    step()
                gc.freeze()  # rules and findings stay until the end
            self.doing = ""
            while not self._stopped:
                if text := self._asked.get():
                    self._statistic(text)
        except Exception as error:  # noqa: BLE001 - the browser goes on with what there is, and says it
            self._note(f"{type(error).__name__}: {error}")
            self.loaded, self.doing, self.failed = True, "", True
            self._begun.set()

    def _decode(self) -> None:
        try:
            if self._run.request.flight is not None and not self._narrowed():
                self.failed = self.refused = True
                return
            for batch in self._run.inside():
                if len(batch.frames) or len(batch.transfers) or len(batch.events) or not self.store.segments:
                    self._comments.feed(batch)
                    self.store.add(batch)
                    self._begun.set()
                if self._stopped:
                    return
        except (CaptureError, StoreFullError) as error:
            self._note(str(error))
            self.failed = True
        self.refused = self._run.state == "refused"
        self.failed = self.failed or self.refused or self._run.state == "damaged"

    def _judging(self) -> Criteria:
        """Return what is judged by; filters may ask for its labels. Raises `ValueError` for a wrong vehicle file."""
        from analyzer.app.criteria import Criteria as Made  # noqa: PLC0415 - rows come first

        criteria = Made(self._run.request.rules, self.registry)
        self._criteria, self.labels = criteria, criteria.labels
        self.severities = {rule: page.severity for rule, page in criteria.pages.items()}
        return criteria

    def _narrowed(self) -> bool:
        """Return whether the window is that of the flight that is asked for; complain if there is none."""
        from analyzer.app.flown import narrow  # noqa: PLC0415 - few ask for a flight

        problem = narrow(self._run)
        if problem is not None:
            self._note(problem)
        return problem is None

    def _stored(self) -> Iterator[Batch]:
        """Yield the batches from the store until the end is asked for."""
        for batch in self.store.batches():
            if self._stopped:
                return
            yield batch

    def _happened(self) -> None:
        """Find flights, events and what broke first."""
        from analyzer.app.browse.happened import happened  # noqa: PLC0415 - rows come first

        self.doing = "flights"
        found = happened(self._run, self._stored())
        if not self._stopped:
            self.flights, self.places = found.flights, found.places
            self._tabs.update(found.tabs)

    def _judge(self) -> None:
        """Judge by all rules, as `check` does."""
        from analyzer.app.browse.tabs import finding_lines  # noqa: PLC0415 - rows come first
        from analyzer.app.judged import JudgedRun  # noqa: PLC0415
        from analyzer.rules.named_frames import NamedFrames  # noqa: PLC0415

        self.doing = "judging"
        named, run, criteria = NamedFrames(), self._run, self._criteria or self._judging()
        judged = JudgedRun(run, criteria, named)
        for _ in judged.batches(self._stored()):
            pass
        if self._stopped:
            return
        report = criteria.report([judged.taken(run.source.name)])
        index = {name: bus for bus, name in enumerate(run.engine.buses)}
        named.finish(
            (one.rule, index.get(one.bus or "", -1), -1 if one.node is None else one.node) for one in report.findings
        )
        self.troubles = [(one.first.t_ns, one.severity) for one in report.findings if one.first.t_ns is not None]
        self.starts = sorted({one.first.frame - 1 for one in report.findings if one.first.frame is not None})
        self._tabs["findings"] = finding_lines(report, self.store.low)
        self.report, self.named = report, named

    def _statistic(self, text: str) -> None:
        from analyzer.app.browse.happened import statistic  # noqa: PLC0415 - few ask

        self.doing = text
        self._tabs["statistics"] = statistic(self._run, text, self._stored())
        self.doing, self.asking = "", False

    def _note(self, text: str) -> None:
        if len(self.notes) < _MOST_NOTES:
            self.notes.append(text)
