"""The browser on a terminal: what is decoded meanwhile is looked at, and keys and clicks are handed on."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, ClassVar

from textual.binding import Binding

from analyzer.browser.screen.keys import EVERY, hints
from analyzer.browser.screen.pages.help import help_page
from analyzer.browser.screen.pressing import Pressing
from analyzer.browser.screen.thrift import DrawnLines
from analyzer.browser.supply import TABS

if TYPE_CHECKING:
    from rich.console import RenderableType
    from textual import events
    from textual.screen import Screen

    from analyzer.browser.screen.strip_pane import StripPane
    from analyzer.browser.screen.tools import Tools
    from analyzer.browser.view import BrowserView

PERIOD = 0.2  # seconds between two looks at what is decoded
_RARELY = 10  # looks until the files themselves are looked at
_ANYWHERE = ("redraw",)  # what keys do on pages and in the line that is typed in, too


class Browser(Pressing):
    """Shows a view until the user quits."""

    BINDINGS: ClassVar[list[Binding]] = [  # type: ignore[assignment]  # Textual allows more kinds
        *(Binding(one.keys, one.action, show=False, priority=one.action in _ANYWHERE) for one in EVERY),
        Binding("ctrl+c", "leave", priority=True),
    ]
    _seen: tuple[object, ...] = ()
    _looks = 0
    _terminal = False

    def __init__(self, view: BrowserView, tools: Tools, start: str = "", *, plain: bool = False) -> None:
        super().__init__(view, tools, start, plain=plain)
        self._drawn = DrawnLines()

    def on_mount(self) -> None:
        """Begin to look at what is decoded."""
        self.tabs.display = False
        self.app_resume_signal.subscribe(self, lambda _: self.action_redraw())
        self._terminal = _has_terminal()
        if not self.view.supply.live:  # a session with a bus hears signals itself
            self._hear()
        self.set_interval(PERIOD, self.look)
        self.call_after_refresh(self.share)
        self.call_after_refresh(self.look)

    def _hear(self) -> None:
        """End in order on SIGTERM, and when the terminal is gone: nothing is to be left in the temporary folder."""
        loop = asyncio.get_running_loop()
        for name in ("SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)
            if number is not None:
                with suppress(NotImplementedError, RuntimeError, ValueError):  # Windows; not the main thread
                    loop.add_signal_handler(number, self._end, 128 + number)

    def _display(self, screen: Screen[object], renderable: RenderableType | None) -> None:
        """Draw no line that is there already."""
        super()._display(screen, self._drawn.update(renderable))

    def action_redraw(self) -> None:
        """Draw everything anew: others may have written onto the terminal."""
        self._drawn.forget()
        self.refresh(repaint=True, layout=True)

    def action_suspend(self) -> None:
        """Stop until the shell has it go on, with the rest of a pipe; recording and a shell that cannot do so go on."""
        if self.view.supply.live:
            self.fail("a session with a bus is not stopped: it records and judges")
        elif not hasattr(os, "getsid") or os.getsid(0) == os.getpgrp():
            self.fail("there is no shell that could have it go on")
        else:
            os.killpg(0, signal.SIGTSTP)  # Textual leaves the terminal in order, and comes back on SIGCONT

    def _end(self, code: int) -> None:
        self.view.supply.stop()
        self.exit(return_code=code)

    def _look_around(self) -> None:
        """Say what has become of the files; end once there is no terminal any more."""
        if text := self.view.supply.changed():
            self.say(text, "warn")
        if self._terminal and not _has_terminal():
            self._end(128 + getattr(signal, "SIGHUP", 1))

    def look(self) -> None:
        """Draw what has changed in what is decoded, found and judged."""
        view, supply = self.view, self.view.supply
        if self.start and len(view.rows):
            self.begin_at()
        self.wait_for_search()
        self.wait_for_walk()
        self.wait_for_order()
        self.wait_for_findings()
        self.check_typed()
        self._looks += 1
        if self._looks % _RARELY == 0:
            self._look_around()
        if self.tools.said:
            self.say(self.tools.said.pop(0))
        if self.following and len(view.rows):
            self.list.to(len(view.rows) - 1)
        rows = len(view.rows), supply.named, getattr(view.rows, "done", True)
        seen = (
            rows, supply.loaded, supply.doing, len(supply.notes), round(supply.share, 2),
            getattr(view.rows, "share", 1), supply.tab(self.tab), len(supply.flights),
        )  # fmt: skip
        if seen == self._seen:
            return
        if self._seen and rows != self._seen[0]:
            self.list.draw()
        self._seen = seen
        if view.anchor is None and len(view.rows):
            self.list.to(0)
        if view.current() != (None if self.shown is None else self.shown.row):  # a filter finds it by and by
            self.show_row()
        if self.tab != TABS[0]:
            self.show_tab()
        self.draw_lines()

    def on_resize(self) -> None:
        """Share the room anew; what stands on the terminal is not known, even if it has the size of before again."""
        self.action_redraw()
        self.call_after_refresh(self.share)
        self.call_after_refresh(self.draw_lines)

    def on_descendant_focus(self) -> None:
        """Give the pane in use its room; the line that was typed in goes when something else is clicked."""
        if self.focused is not self.bar:
            self.bar.display, self.state.display = False, True
        self.call_after_refresh(self.share)

    def on_packet_list_moved(self) -> None:
        """Show the row that the list is at, once for several moves that came at once."""
        self.settle()

    def on_detail_pane_selected(self) -> None:
        """Light what a detail speaks of."""
        self.light()

    def on_bytes_pane_selected(self) -> None:
        """Select the detail that speaks of a byte."""
        self.select_by_byte()

    def on_strip_pane_went(self, event: StripPane.Went) -> None:
        """Go to a time."""
        self.go_to_time(event.t)

    async def on_click(self, event: events.Click) -> None:
        """Do what the last line tells of where it is clicked; type a filter, or see the notes, by their lines."""
        if event.widget is self.state:
            self.action_ask_filter()
        elif event.widget is self.top and self.view.supply.notes:
            self.action_tab("notes")
        at = 1
        for text, action in hints(self.tab) if event.widget is self.bottom and not self.said else ():
            if at <= event.x < at + len(text):
                await self.run_action(action)
                return
            at += len(text) + 2

    def action_next_tab(self) -> None:
        """Show the next tab."""
        self.action_tab(TABS[(TABS.index(self.tab) + 1) % len(TABS)])

    def on_tab_pane_chosen(self) -> None:
        """Go where a line leads to."""
        self.action_choose()

    def action_help(self) -> None:
        """Show what keys mean."""
        self.open_page(help_page())

    def _fatal_error(self) -> None:
        """End with a line in place of the traceback that Textual would print."""
        error = self._exception
        self.view.supply.notes.append(f"{type(error).__name__}: {error}: please report this as a bug")
        self._close_messages_no_wait()


def _has_terminal() -> bool:
    return sys.__stdin__ is not None and not sys.__stdin__.closed and sys.__stdin__.isatty()
