"""Browsers over captures, driven by Textual's pilot."""

from __future__ import annotations

from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

from analyzer.app.browse.capture import CaptureSupply
from analyzer.app.browse.session import BrowseOptions, made
from analyzer.app.request import Request, RuleChoice
from analyzer.browser.store.folder import StoreFolder
from analyzer.views.colours.rules import colour_rules
from analyzer.window.limits import Window
from kit.pages import ROOT

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable
    from pathlib import Path

    from textual.pilot import Pilot

    from analyzer.browser.screen.app import Browser

_PATIENCE = 1200  # looks, 0.05 s each, on a machine that others use


class Seen:
    """A browser that runs, and its pilot."""

    def __init__(self, app: Browser, pilot: Pilot[None]) -> None:
        self.app, self.pilot = app, pilot

    async def press(self, *keys: str) -> None:
        """Press keys, and let it settle."""
        await self.pilot.press(*keys)
        await self.pilot.pause()

    async def type(self, text: str) -> None:
        """Type text, and enter."""
        self.app.bar.value = text
        await self.press("enter")

    async def until(self, holds: Callable[[], bool]) -> None:
        """Wait until something holds."""
        for _ in range(_PATIENCE):
            if holds():
                return
            await self.pilot.pause(0.05)
        raise AssertionError(self.screen)

    async def filtered(self, text: str) -> None:
        """Apply a filter, and wait for all of its rows."""
        await self.press("equals_sign")
        await self.type(text)
        await self.until(lambda: getattr(self.app.view.rows, "done", True))
        self.app.look()
        await self.pilot.pause()

    @property
    def screen(self) -> str:
        """All lines."""
        strips = self.app.screen._compositor.render_strips()
        return "\n".join("".join(segment.text for segment in strip).rstrip() for strip in strips)

    @property
    def row(self) -> str:
        """The line of the current row."""
        row = self.app.view.current()
        return "" if row is None else self.app.view.pages.lines([row], 200)[0].text

    @property
    def said(self) -> str:
        """The last line."""
        return self.app.bottom.text


@asynccontextmanager
async def browser(
    path: str | Path, size: tuple[int, int] = (80, 24), options: BrowseOptions | None = None, *, judged: bool = True,
    window: Window | None = None, vehicle: str | None = None,
) -> AsyncIterator[Seen]:  # fmt: skip
    """Open a capture; with `judged` everything is known when the block begins."""
    with StoreFolder() as folder:
        supply = CaptureSupply(
            Request((str(path),), window=window or Window(), rules=RuleChoice(vehicle=vehicle)), folder.path
        )
        app = made(supply, options or BrowseOptions(marks=False), colour_rules(None, supply.registry))
        supply.start()
        async with app.run_test(size=size) as pilot:
            seen = Seen(app, pilot)
            await seen.until(lambda: supply.loaded and (not judged or not supply.doing))
            app.look()
            await pilot.pause()
            yield seen
        supply.stop()
        supply.join()


def capture(name: str) -> str:
    """Return the path of one of the captures."""
    return str(ROOT / "captures" / name)
