"""The browser on a terminal: lays the panes out, looks at what is decoded meanwhile, and hands keys on."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.app import App
from textual.binding import Binding
from textual.containers import Container

from analyzer.browser.chosen import ChosenRows
from analyzer.browser.dump import lit_by, line_at
from analyzer.browser.screen.bar import Bar
from analyzer.browser.screen.bytes_pane import BytesPane
from analyzer.browser.screen.detail_pane import DetailPane
from analyzer.browser.screen.gestures import Gestures
from analyzer.browser.screen.handing import Handing
from analyzer.browser.screen.help import HelpPage
from analyzer.browser.screen.keys import EVERY, HINT
from analyzer.browser.screen.lines import Lines, padded
from analyzer.browser.screen.list_pane import PacketList
from analyzer.browser.screen.moving import Moving
from analyzer.browser.screen.strip_pane import StripPane
from analyzer.browser.screen.styles import NAMED
from analyzer.browser.screen.tab_pane import TabPane
from analyzer.browser.supply import TABS
from analyzer.filter.names import FilterNames
from analyzer.views.terminal import escape, fit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from textual.app import ComposeResult

    from analyzer.browser.screen.handing import Tools
    from analyzer.browser.view import BrowserView, Shown

PERIOD = 0.2  # seconds between two looks at what is decoded
_AROUND = 4  # lines that are no pane: top, strip, filter, bottom
_WIDE, _HIGH = 120, 30  # from here on details and bytes stand side by side
_LEAST = {"details": 5, "bytes": 3}


class Browser(Moving, Gestures, Handing, App[None]):
    """Shows a view; `start` is a command for its first look: a place as `g` takes it."""

    CSS: ClassVar[str] = (
        "Screen { layout: vertical; overflow: hidden; } #top, #strip, #state, #bottom, #bar { height: 1; }"
        " #lower { overflow: hidden; } #bar { display: none; border: none; padding: 0; background: ansi_default; }"
        " Browser { background: ansi_default; }"
    )
    ENABLE_COMMAND_PALETTE: ClassVar[bool] = False
    AUTO_FOCUS: ClassVar[str | None] = "#list"
    BINDINGS: ClassVar[list[Binding]] = [  # type: ignore[assignment]  # Textual allows more kinds
        *(Binding(one.keys, one.action, show=False) for one in EVERY),
        Binding("ctrl+c", "leave", priority=True),
    ]

    def __init__(self, view: BrowserView, tools: Tools, start: str = "", *, plain: bool = False) -> None:
        super().__init__(ansi_color=True)
        self.theme = "ansi-dark"
        self.view, self.tools = view, tools
        self.tab = TABS[0]
        self.shown: Shown | None = None
        self._start = start
        self._said, self._said_style = "", ""
        self._names: Sequence[str] = ()
        self._seen: tuple[object, ...] = ()
        self.top, self.state, self.bottom = Lines("top"), Lines("state"), Lines("bottom")
        self.strip = StripPane(view, plain=plain)
        self.list, self.details, self.bytes, self.tabs = PacketList(view), DetailPane(), BytesPane(), TabPane()
        self.lower = Container(self.details, self.bytes, id="lower")
        self.bar = Bar(self.names)
        self.panes = (self.list, self.details, self.bytes)
        self._begin()

    def compose(self) -> ComposeResult:
        """Lay the lines and panes out from top to bottom."""
        yield from (self.top, self.strip, self.state, self.bar, self.list, self.lower, self.tabs, self.bottom)

    def on_mount(self) -> None:
        """Begin to look at what is decoded."""
        self.tabs.display = False
        self.set_interval(PERIOD, self.look)
        self.call_after_refresh(self.share)
        self.call_after_refresh(self.look)

    def names(self) -> Sequence[str]:
        """Return the names of fields for completion, made once."""
        if not self._names:
            refs = FilterNames(self.view.supply.registry).catalogue()
            self._names = sorted({ref.name for ref in refs} | {ref.name.rpartition("esc.")[2] for ref in refs})
        return self._names

    # ---- drawing

    def look(self) -> None:
        """Draw what has changed in what is decoded, found and judged."""
        view, supply = self.view, self.view.supply
        if self._start and len(view.rows):
            self._begin_at()
        self.wait_for_search()
        if self.tools.said:
            self.say(self.tools.said.pop(0))
        if self.following and len(view.rows):
            self.list.to(len(view.rows) - 1)
        seen = (
            len(view.rows), supply.loaded, supply.doing, supply.named, len(supply.notes), round(supply.share, 2),
            getattr(view.rows, "done", True), supply.tab(self.tab), len(supply.flights),
        )  # fmt: skip
        if seen == self._seen:
            return
        if self._seen and (seen[0] != self._seen[0] or seen[3] is not self._seen[3]):
            view.pages.named = supply.named
            self.list.draw()
        self._seen = seen
        if view.anchor is None and len(view.rows):
            self.list.to(0)
        if self.shown is None and view.current() is not None:
            self.show_row()
        if self.tab != TABS[0]:
            self.show_tab()
        self.draw_lines()

    def draw_lines(self) -> None:
        """Draw the lines that are no panes."""
        view, width = self.view, self.size.width
        supply = view.supply
        doing = supply.doing if supply.loaded else f"{supply.doing} {supply.share:.0%}"
        if supply.live and not supply.loaded:
            doing = "live, following" if self.following else "live, held"
        counts = f"{view.store.frames:,} frames"
        notes = f"  {len(supply.notes)} note{'s' * (len(supply.notes) != 1)}" if supply.notes else ""
        right = f"{counts}{notes}  {doing}".rstrip() + " "
        left = fit(f" {escape(supply.name)}", max(8, width - len(right) - 1))
        self.top.put([((padded(left, width - len(right)) + right, NAMED["title"]),)])
        self.strip.draw()
        self.state.put([self._state(width)])
        text, style = (self._said, self._said_style) if self._said else (HINT, "dim")
        self.bottom.put([((padded(fit(f" {text}", width), width), NAMED[style]),)])

    def _state(self, width: int):  # type: ignore[no-untyped-def]  # noqa: ANN202 - spans
        view = self.view
        count, at = len(view.rows), view.number() + 1 if len(view.rows) else 0
        where = f"row {at:,} of {count:,}"
        if isinstance(view.rows, ChosenRows):
            where += "" if view.rows.done else f" so far, {view.rows.share:.0%}"
            if view.rows.problem is not None:
                where = f"the filter failed: {view.rows.problem}"
        place = "" if self.tab == TABS[0] else f"tab {TABS.index(self.tab) + 1} {self.tab}  "
        right = f" {place}{where} "
        filtered = f" = {view.filter}" if view.filter else " = (no filter)"
        left = padded(fit(filtered, max(4, width - len(right))), width - len(right))
        return (left, NAMED["good" if view.filter else "dim"]), (fit(right, width), NAMED[""])

    def say(self, text: str, style: str = "") -> None:
        """Show a line in place of the keys until the next key."""
        self._said, self._said_style = " ".join(text.split("\n")), style
        self.draw_lines()

    def fail(self, text: str) -> None:
        """Say why something is not done."""
        self.say(text, "bad")

    def share(self) -> None:
        """Share the room among the panes: the one in use gets more."""
        width, height = self.size
        room = max(3, height - _AROUND)
        if self.tab != TABS[0]:
            self.tabs.styles.height = room
            return
        wide = width >= _WIDE and height >= _HIGH
        used = self.focused.id if self.focused in self.panes else "list"
        self.lower.styles.layout = "horizontal" if wide else "vertical"
        if wide:
            upper = room * 11 // 20 if used == "list" else room * 2 // 5
            sizes = {"details": room - upper, "bytes": room - upper}
            self.details.styles.width, self.bytes.styles.width = "1fr", 78
        else:
            sizes = dict(_LEAST) if height < _HIGH else {"details": room // 3, "bytes": max(4, room // 6)}
            if used in sizes:
                others = sum(size for name, size in sizes.items() if name != used)
                sizes[used] = max(sizes[used], room - 6 - others)
            if room < 14:  # noqa: PLR2004 - too low for three
                sizes = {name: (room - 4 if name == used else 0) for name in sizes}
            upper = max(3, room - sum(sizes.values()))
            self.details.styles.width = self.bytes.styles.width = "100%"
        self.list.styles.height = upper
        self.lower.styles.height = max(0, room - upper)
        self.lower.display = room > upper
        for pane in (self.details, self.bytes):
            pane.styles.height = sizes[str(pane.id)]
            pane.display = sizes[str(pane.id)] > 0

    def on_resize(self) -> None:
        """Share the room anew."""
        self.call_after_refresh(self.share)
        self.call_after_refresh(self.draw_lines)

    def on_descendant_focus(self) -> None:
        """Give the pane in use its room."""
        self.call_after_refresh(self.share)

    # ---- the row, its details and bytes

    def show_row(self) -> None:
        """Show the current row in full."""
        row = self.view.current()
        self.shown = None if row is None else self.view.shown(row)
        self.bytes.take(() if self.shown is None else self.shown.frames)
        self.details.take(() if self.shown is None else self.shown.lines)
        self.light()
        self.draw_lines()

    def light(self) -> None:
        """Light the bytes of the current detail."""
        if self.shown is not None:
            self.bytes.light(lit_by(self.details.line, self.shown.frames))

    def on_packet_list_moved(self) -> None:
        """Show the row that the list is at."""
        self.show_row()

    def on_detail_pane_selected(self) -> None:
        """Light what a detail speaks of."""
        self.light()

    def on_bytes_pane_selected(self) -> None:
        """Select the detail that speaks of a byte."""
        if self.shown is None:
            return
        index = line_at(self.shown.lines, self.shown.frames, self.bytes.at)
        if index is not None:
            self.details.select(index)

    def on_strip_pane_went(self, event: StripPane.Went) -> None:
        """Go to a time."""
        self.go_to_time(event.t)

    def on_tab_pane_chosen(self) -> None:
        """Go where a line leads to."""
        self.action_choose()

    # ---- tabs and pages

    def action_tab(self, name: str) -> None:
        """Show a tab, or the three panes."""
        self.tab = name
        packets = name == TABS[0]
        self.list.display = self.lower.display = packets
        self.tabs.display = not packets
        self.share()
        if packets:
            self.set_focus(self.list)
        else:
            self.show_tab()
            self.set_focus(self.tabs)
        self.draw_lines()

    def show_tab(self) -> None:
        """Show what the tab has by now."""
        supply = self.view.supply
        empty = "not known yet: the capture is still being read and judged"
        if self.tab == "statistics" and not supply.doing:
            empty = "press s for a statistic: talkers, nodes, services, periods, load, hierarchy, io, values,FIELD"
        self.tabs.take(self.tab.capitalize(), supply.tab(self.tab), empty)

    def action_help(self) -> None:
        """Show what keys mean."""
        self.push_screen(HelpPage())

    def on_key(self) -> None:
        """Forget what was said."""
        if self._said:
            self._said = ""
            self.draw_lines()
