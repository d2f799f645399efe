"""What stands on the terminal is what the browser shows, although only lines that differ are sent."""

from __future__ import annotations

import asyncio
import shutil
from typing import TYPE_CHECKING

import pytest
from kit.browsing import Seen, browser, capture
from kit.emulated import EmulatedTerminal, sends_to
from textual.events import Key, Resize
from textual.geometry import Size

from analyzer.app.browse.session import BrowseOptions

if TYPE_CHECKING:
    from pathlib import Path

FAULTS = capture("mission-8-faults.log")
WIDE = '[[mark]]\nframe = 1\ntext = "過熱 過熱 🔥"\n[[mark]]\nframe = 4\ntext = "é̂ ok"\n'
WALKS = {
    "panes": "down tab down down tab right right tab pagedown end home",
    "pages": "question_mark down pagedown x space down down escape f10 pagedown escape",
    "tabs": "2 down 3 right right 4 5 pagedown 6 7 1 2 E q 1 tab 2 1",
    "lines": "equals_sign E S C tab escape slash 0 escape g 5 0 percent_sign enter",
    "rows": "v down down m v c greater_than_sign i number_sign T t I right_parenthesis",
}


PRESSES = 12


def slowly(*values: object) -> list[object]:
    """Return parameters that are tried in the slow run."""
    return [pytest.param(one, marks=pytest.mark.slow) for one in values]


class Drawn(Seen):
    """A browser that draws on a terminal, too."""

    terminal: EmulatedTerminal
    sent = 0

    def agree(self, when: str) -> None:
        """Assert that the terminal shows what the browser does."""
        assert self.terminal.screen == self.screen, when


@pytest.fixture
def drawing(monkeypatch: pytest.MonkeyPatch) -> type[Drawn]:
    """Return what makes a browser draw."""
    monkeypatch.setattr(Drawn, "terminal", EmulatedTerminal(80, 24), raising=False)

    def taken(text: str) -> None:
        Drawn.sent += len(text)
        Drawn.terminal.feed(text)

    sends_to(taken, monkeypatch)
    return Drawn


@pytest.mark.parametrize("walk", WALKS)
@pytest.mark.parametrize("size", [(80, 24), pytest.param((132, 40), marks=pytest.mark.slow)])
def test_every_step_of_a_walk(walk: str, size: tuple[int, int], drawing: type[Drawn], tmp_path: Path) -> None:
    path = tmp_path / "flight.log"
    shutil.copy(FAULTS, path)
    (tmp_path / "flight.log.marks.toml").write_text(WIDE)
    drawing.terminal.resize(*size)

    async def work() -> None:
        async with browser(path, size, options=BrowseOptions()) as plain:
            seen = drawing(plain.app, plain.pilot)
            for k, key in enumerate(WALKS[walk].split()):
                await seen.press(key)
                seen.agree(f"{k}: {key}")

    asyncio.run(work())


@pytest.mark.parametrize("over", ["", "question_mark", *slowly("space", "equals_sign", "2")])
def test_a_terminal_that_somebody_has_cleared_is_drawn_anew(over: str, drawing: type[Drawn]) -> None:
    async def work() -> None:
        async with browser(FAULTS) as plain:
            seen = drawing(plain.app, plain.pilot)
            await seen.press(*filter(None, [over]))
            before = seen.screen
            drawing.terminal.resize(80, 24)
            await seen.press("ctrl+l")
            seen.agree("cleared")
            assert seen.screen == before

    asyncio.run(work())


@pytest.mark.parametrize("sizes", [[(80, 24)], *slowly([(100, 30), (80, 24)], [(100, 30)], [(40, 12), (60, 20)])])
@pytest.mark.parametrize("over", ["", *slowly("question_mark", "space", "equals_sign", "2")])
def test_whatever_size_a_terminal_takes_it_is_drawn_anew(
    sizes: list[tuple[int, int]], over: str, drawing: type[Drawn]
) -> None:  # fmt: skip
    async def work() -> None:
        async with browser(FAULTS, judged=False) as plain:
            seen = drawing(plain.app, plain.pilot)
            await seen.press(*filter(None, [over]))
            drawing.terminal.resize(*sizes[-1])
            for width, height in sizes:
                seen.app.post_message(Resize(Size(width, height), Size(width, height)))
            await seen.until(lambda: seen.app.size == sizes[-1] and drawing.terminal.screen == seen.screen)

    asyncio.run(work())


@pytest.mark.parametrize("page", ["question_mark", "space"])
def test_keys_that_come_at_once_leave_a_page_once(page: str) -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await seen.press(page)
            for key in ("escape", "escape", "end", "2"):
                seen.app.post_message(Key(key, None))
            await seen.until(lambda: seen.app.tab == "findings")
            assert seen.app.view.number() == len(seen.app.view.rows) - 1

    asyncio.run(work())


def test_a_key_costs_few_bytes_and_waiting_none(drawing: type[Drawn]) -> None:
    async def work() -> None:
        async with browser(FAULTS) as seen:
            drawing.sent = 0
            for _ in range(PRESSES):
                await seen.press("down")
            assert 0 < drawing.sent < PRESSES * 1900  # a screen of letters alone has 1920
            drawing.sent = 0
            for _ in range(PRESSES):
                seen.app.look()
                await seen.pilot.pause()
            assert drawing.sent == 0

    asyncio.run(work())
