"""What stands on the terminal is what the monitor shows, whatever others do to that terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit.emulated import EmulatedTerminal, sends_to
from kit.monitor import SMALL, WIDE, Script, session, text, until, use
from textual.events import Resize
from textual.geometry import Size

if TYPE_CHECKING:
    from textual.pilot import Pilot

    from analyzer.terminal.app import Monitor


def _stands(terminal: EmulatedTerminal, app: Monitor) -> bool:
    return terminal.screen == "\n".join(line.rstrip() for line in text(app).splitlines())


@pytest.mark.parametrize("page", ["", "question_mark"])
@pytest.mark.parametrize("sizes", [[SMALL], [WIDE, SMALL], [WIDE]])
def test_whatever_size_a_terminal_takes_it_is_drawn_anew(
    sizes: list[tuple[int, int]], page: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    terminal = EmulatedTerminal(*SMALL)
    sends_to(terminal.feed, monkeypatch)

    async def does(app: Monitor, pilot: Pilot[None]) -> None:
        await pilot.press(*filter(None, [page]))
        await until(pilot, lambda: _stands(terminal, app))
        terminal.resize(*sizes[-1])
        for size in sizes:
            app.post_message(Resize(Size(*size), Size(*size)))
        await until(pilot, lambda: app.size == sizes[-1] and _stands(terminal, app))

    use(Script([session("hover-4.log")]), does)


@pytest.mark.parametrize("page", ["", "question_mark"])
def test_a_terminal_that_somebody_has_cleared_is_drawn_anew(page: str, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = EmulatedTerminal(*SMALL)
    sends_to(terminal.feed, monkeypatch)

    async def does(app: Monitor, pilot: Pilot[None]) -> None:
        await pilot.press(*filter(None, [page]))
        await until(pilot, lambda: _stands(terminal, app))
        terminal.resize(*SMALL)
        await pilot.press("ctrl+l")
        await until(pilot, lambda: _stands(terminal, app))

    use(Script([session("hover-4.log")]), does)
