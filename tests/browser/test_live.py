"""A bus in the browser: what comes is followed, or held; findings come while it runs."""

from __future__ import annotations

import asyncio
import threading
from types import SimpleNamespace
from typing import TYPE_CHECKING

from kit.browsing import Seen, capture

from analyzer.app.browse.live import LiveSupply
from analyzer.app.browse.live_names import LiveNames
from analyzer.app.browse.session import BrowseOptions, made
from analyzer.app.criteria import Criteria
from analyzer.app.request import Request, RuleChoice
from analyzer.app.run import Run
from analyzer.browser import chosen
from analyzer.browser.view import BrowserView
from analyzer.report.newest import Newest
from analyzer.rules.checking import Check

if TYPE_CHECKING:
    from pathlib import Path

    import pytest

    from analyzer.browser.store.store import TableStore
    from analyzer.filter.matcher import Matcher
    from dissectors.kit import Array


class Bus:
    """A bus that plays a capture, judged as it comes; `feed` lets so many pieces of it come."""

    def __init__(self, folder: Path, name: str = "") -> None:
        run = Run(Request((capture("mission-8-faults.log"),)))
        criteria, names = Criteria(RuleChoice(), run.registry), LiveNames()
        self.ended: list[bool] = []
        recorded = str(folder / name) if name else ""
        self.supply = LiveSupply(criteria, "can0", folder, lambda: self.ended.append(True), names, recorded)
        self.supply.look(SimpleNamespace(reading=run))
        threading.Thread(target=self.supply._work, daemon=True).start()
        self._check, self._run = Check(run.registry, criteria.settings, names), run
        self._newest = Newest(self._check.judge, criteria.settings, criteria.revisions(), now=lambda: 0.0)
        self.pieces = []
        with open(capture("mission-8-faults.log"), "rb") as file:  # noqa: PTH123 - in pieces
            while chunk := file.read(100_000):
                self.pieces += [*run.engine.feed(chunk), *run.engine.flushed()]

    def feed(self, count: int, *, told: bool = True) -> None:
        for measured in self._check.measured([self.pieces.pop(0) for _ in range(count)]):
            self._check.feed(measured)
            self.supply.batch(measured)
            if told:
                self.tell()

    def tell(self) -> None:
        self.supply.found(self._newest.look(self._run.engine.buses, last=not self.pieces))


def test_a_bus_is_followed_and_held(tmp_path: Path) -> None:
    bus = Bus(tmp_path)

    async def work() -> None:
        app = made(bus.supply, BrowseOptions(), [])
        app.following = True
        async with app.run_test(size=(80, 24)) as pilot:
            seen = Seen(app, pilot)
            bus.feed(3)
            await seen.until(lambda: app.view.number() > 0)
            before = app.view.number()
            assert before == len(app.view.rows) - 1
            assert "live, following" in seen.screen
            await seen.press("up")
            bus.feed(2)
            await seen.until(lambda: len(app.view.rows) > before + 1)
            app.look()
            await pilot.pause()
            assert app.view.number() == before - 1
            assert "live, held" in seen.screen
            await seen.press("end")
            assert app.following
            await seen.press("w")
            await seen.type(str(tmp_path / "x.log"))
            assert "record it" in seen.said

    asyncio.run(work())


def test_tabs_filters_and_marks_of_a_bus(tmp_path: Path) -> None:
    bus = Bus(tmp_path, "bench.log")
    bus.feed(len(bus.pieces))

    async def work() -> None:
        app = made(bus.supply, BrowseOptions(), [])
        async with app.run_test(size=(80, 24)) as pilot:
            seen = Seen(app, pilot)
            await seen.press("2")
            assert "CAN-005" in seen.screen
            assert seen.screen.splitlines()[4].startswith((" note ", " warn ", " error"))
            await seen.press("a")
            assert app.view.filter.startswith('finding.rule == "')
            await seen.until(lambda: len(app.view.rows) > 0)
            await seen.press("escape", "right_square_bracket", "m")
            assert (tmp_path / "bench.log.marks.toml").exists()
            wanted: list[str] = []
            app.tools.write = lambda _, text: wanted.append(text) or "writing"
            await seen.press("w")
            await seen.type("part.log")
            assert wanted == ["frame.number in {1..10220}"]
            for key, word in (("4", "flight 1"), ("3", "what happened"), ("5", "What broke first")):
                await seen.press(key)
                await seen.until(lambda: bus.supply.tab(app.tab) is not None)
                app.look()
                await pilot.pause()
                assert "came until this was asked for" in seen.screen
                assert word in seen.screen
            await seen.press("s")
            await seen.type("talkers")
            await seen.until(lambda: bus.supply.tab("statistics") is not None)
            await seen.press("1", "equals_sign")
            await seen.type("ESCStatus")
            await seen.until(lambda: len(app.view.rows) > 100)
            await seen.press("q")
            assert bus.ended

    asyncio.run(work())


def test_rows_of_before_are_chosen_when_a_finding_names_them(tmp_path: Path) -> None:
    bus = Bus(tmp_path)

    async def work() -> None:
        app = made(bus.supply, BrowseOptions(filter="finding.rule"), [])
        async with app.run_test(size=(80, 24)) as pilot:
            seen = Seen(app, pilot)
            bus.feed(len(bus.pieces), told=False)
            await seen.until(lambda: app.view.rows.share == 1)
            assert len(app.view.rows) == 0
            bus.tell()
            await seen.until(lambda: len(app.view.rows) > 5)
            whole = BrowserView(bus.supply)
            whole.apply("finding.rule")
            await seen.until(lambda: whole.rows.share == 1 and len(whole.rows) == len(app.view.rows))
            for rows in (whole.rows, app.view.rows):
                rows.stop()

    asyncio.run(work())


def test_details_go_with_the_row_that_is_found_in_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The row one is at is looked at last: until then another one is the current one."""
    go_on, matching, bus = threading.Event(), chosen.matching_rows, Bus(tmp_path)

    def held(store: TableStore, at: int, matcher: Matcher) -> Array:
        if at == len(store.segments) - 1:
            go_on.wait(600)
        return matching(store, at, matcher)

    monkeypatch.setattr(chosen, "matching_rows", held)
    bus.feed(len(bus.pieces))

    async def work() -> None:
        app = made(bus.supply, BrowseOptions(), [])
        async with app.run_test(size=(80, 24)) as pilot:
            seen = Seen(app, pilot)
            await seen.press("end", "up", "equals_sign")  # it is held
            await seen.type("dronecan.type_id > 0")
            await seen.until(lambda: len(app.view.rows) > 0)
            app.look()
            assert app.shown.row == app.view.current()
            go_on.set()
            await seen.until(lambda: app.view.rows.share == 1)
            app.look()
            await pilot.pause()
            assert app.view.number() == len(app.view.rows) - 2
            assert app.shown.row == app.view.current()
            assert str(min(app.view.places_of(app.shown.row)) + 1) in app.bytes.text
            app.view.rows.stop()

    asyncio.run(work())
