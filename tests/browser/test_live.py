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
from analyzer.report.newest import Newest
from analyzer.rules.checking import Check

if TYPE_CHECKING:
    from pathlib import Path


def test_a_bus_is_followed_and_held(tmp_path: Path) -> None:
    run = Run(Request((capture("mission-8-faults.log"),)))
    criteria = Criteria(RuleChoice(), run.registry)
    ended: list[bool] = []
    names = LiveNames()
    supply = LiveSupply(criteria, "can0", tmp_path, lambda: ended.append(True), names, str(tmp_path / "bench.log"))
    supply.look(SimpleNamespace(reading=run))
    check = Check(run.registry, criteria.settings, names)
    newest = Newest(check.judge, criteria.settings, criteria.revisions(), now=lambda: 0.0)
    pieces = []
    with open(capture("mission-8-faults.log"), "rb") as file:  # noqa: PTH123 - in pieces
        while chunk := file.read(100_000):
            pieces += [*run.engine.feed(chunk), *run.engine.flushed()]

    def feed(count: int) -> None:
        for measured in check.measured([pieces.pop(0) for _ in range(count)]):
            check.feed(measured)
            supply.batch(measured)
            supply.found(newest.look(run.engine.buses))

    async def work() -> None:
        threading.Thread(target=supply._work, daemon=True).start()
        app = made(supply, BrowseOptions(), [])
        app.following = True
        async with app.run_test(size=(80, 24)) as pilot:
            seen = Seen(app, pilot)
            feed(3)
            await seen.until(lambda: app.view.number() > 0)
            before = app.view.number()
            assert before == len(app.view.rows) - 1
            assert "live, following" in seen.screen
            await seen.press("up")
            feed(2)
            await seen.until(lambda: len(app.view.rows) > before + 1)
            app.look()
            await pilot.pause()
            assert app.view.number() == before - 1
            assert "live, held" in seen.screen
            await seen.press("end")
            assert app.following
            feed(len(pieces))
            supply.found(newest.look(run.engine.buses, last=True))
            await seen.press("2")
            assert "CAN-005" in seen.screen
            await seen.press("a")
            await seen.until(lambda: len(app.view.rows) > 0)
            assert app.view.filter.startswith('finding.rule == "')
            await seen.press("escape", "right_square_bracket", "m")
            assert (tmp_path / "bench.log.marks.toml").exists()
            for key, word in (("4", "flight 1"), ("3", "what happened"), ("5", "What broke first")):
                await seen.press(key)
                await seen.until(lambda: supply.tab(app.tab) is not None)
                app.look()
                await pilot.pause()
                assert "came until this was asked for" in seen.screen
                assert word in seen.screen
            await seen.press("s")
            await seen.type("talkers")
            await seen.until(lambda: supply.tab("statistics") is not None)
            await seen.press("1", "equals_sign")
            await seen.type("ESCStatus")
            await seen.until(lambda: len(app.view.rows) > 100)
            await seen.press("w")
            await seen.type(str(tmp_path / "x.log"))
            assert "record it" in seen.said
            await seen.press("q")
            assert ended

    asyncio.run(work())
