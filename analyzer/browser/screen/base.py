"""The browser on a terminal: its panes and lines, what they show, and how they share the room."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.app import App
from textual.containers import Container

from analyzer.browser.chosen import ChosenRows
from analyzer.browser.conditions import field_name
from analyzer.browser.dump import line_at, lit_by
from analyzer.browser.screen.bar import Bar
from analyzer.browser.screen.bytes_pane import BytesPane
from analyzer.browser.screen.detail_pane import DetailPane
from analyzer.browser.screen.keys import hints
from analyzer.browser.screen.lines import Lines, padded
from analyzer.browser.screen.list_pane import PacketList
from analyzer.browser.screen.pages.page import ScreenPage
from analyzer.browser.screen.strip_pane import StripPane
from analyzer.browser.screen.styles import NAMED
from analyzer.browser.screen.tab_pane import TabPane
from analyzer.browser.sorted_rows import SortedRows
from analyzer.browser.supply import TABS, TabLine
from analyzer.filter.names import FilterNames
from analyzer.stats.catalogue import STATISTICS
from analyzer.views.terminal import escape, fit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from textual.app import ComposeResult

    from analyzer.browser.screen.lines import Spans
    from analyzer.browser.screen.tools import Tools
    from analyzer.browser.search import Search
    from analyzer.browser.view import BrowserView, ShownRow

_AROUND = 4  # lines that are no pane: top, strip, filter, bottom
_WIDE, _HIGH = 120, 30  # from here on details and bytes stand side by side
_LOW = 14  # lines that three panes need
_LEAST = {"details": 5, "bytes": 3}


class BrowserBase(App[None]):
    """Lays the panes out and draws them; keys come in the classes made from it."""

    CSS: ClassVar[str] = (
        "Screen { layout: vertical; overflow: hidden; } #top, #strip, #state, #bottom, #bar { height: 1; }"
        " #lower { overflow: hidden; } #bar { display: none; border: none; padding: 0 0 0 1; }"
        " #bar { background: ansi_default; } #bar.good { color: ansi_green; } #bar.bad { color: ansi_red; }"
    )
    ENABLE_COMMAND_PALETTE: ClassVar[bool] = False
    AUTO_FOCUS: ClassVar[str | None] = "#list"

    def __init__(self, view: BrowserView, tools: Tools, start: str = "", *, plain: bool = False) -> None:
        super().__init__(ansi_color=True)
        self.theme = "ansi-dark"
        self.view, self.tools, self.plain = view, tools, plain
        self.chord = ""
        self.tab = TABS[0]
        self.shown: ShownRow | None = None
        self.start = start
        self.said, self.said_style = "", ""
        self._names: Sequence[str] = ()
        self.top, self.state, self.bottom = Lines("top"), Lines("state"), Lines("bottom")
        self.strip = StripPane(view, plain=plain)
        self.list, self.details, self.bytes, self.tabs = PacketList(view), DetailPane(), BytesPane(), TabPane()
        self.lower = Container(self.details, self.bytes, id="lower")
        self.bar = Bar(self.names)
        self.panes = (self.list, self.details, self.bytes)
        self.following, self.wanted = False, 0
        self.awaited = ""  # a filter that waits for findings
        self._back: list[tuple[int, int]] = []  # places that were left by a jump, and those that were gone back from
        self._ahead: list[tuple[int, int]] = []
        self.search: Search | None = None  # and `wanted` the step to the match that is waited for

    def compose(self) -> ComposeResult:
        """Lay the lines and panes out from top to bottom."""
        yield from (self.top, self.strip, self.state, self.bar, self.list, self.lower, self.tabs, self.bottom)

    def names(self) -> Sequence[str]:
        """Return the names of fields for completion, made once."""
        if not self._names:
            refs = FilterNames(self.view.supply.registry).catalogue()
            self._names = sorted({ref.name for ref in refs} | {ref.name.rpartition("esc.")[2] for ref in refs})
        return self._names

    def draw_lines(self) -> None:
        """Draw the lines that are no panes."""
        view, width = self.view, self.size.width
        supply = view.supply
        doing = supply.doing if supply.loaded or supply.share in (0, 1) else f"{supply.doing} {supply.share:.0%}"
        if supply.live and not supply.loaded:
            doing = "live, following" if self.following else "live, held"
        counts = f"{view.store.count:,} frames"
        notes = f"  {len(supply.notes)} note{'s' * (len(supply.notes) != 1)} (7)" if supply.notes else ""
        right = f"{counts}{notes}  {doing}".rstrip() + " "
        left = fit(f" {escape(supply.name)}", max(8, width - len(right) - 1))
        self.top.put([((padded(left, width - len(right)) + right, NAMED["title"]),)])
        self.strip.draw()
        self.state.put([self._state(width)])
        text, style = (
            (self.said, self.said_style)
            if self.said
            else (
                "  ".join(text for text, _ in hints(self.tab)),
                "dim",
            )
        )
        self.bottom.put([((padded(fit(f" {text}", width), width), NAMED[style]),)])

    def _state(self, width: int) -> Spans:
        view = self.view
        count, at = len(view.rows), view.number() + 1 if len(view.rows) else 0
        where = f"row {at:,} of {count:,}"
        order = view.rows if isinstance(view.rows, SortedRows) else None
        rows = view.rows if order is None else order.base
        if isinstance(rows, ChosenRows) and len(view.store):
            where += f" ({count / len(view.store):.2%})"
        if view.begun is not None:
            where = f"{len(view.selected()):,} selected  {where}"
        if isinstance(rows, ChosenRows):
            share = rows.share
            where += "" if rows.done else f" so far, {share:.0%}" if share < 1 else " so far"
            if rows.problem is not None:
                where = f"the filter failed: {escape(str(rows.problem))}"
        if order is not None:
            way = "falling" if order.falling else "rising"
            where = f"{order.name} {way}{'' if order.done else ' ...'}  {where}"
            if order.problem is not None:
                where = f"it cannot be sorted: {escape(str(order.problem))}"
        place = "" if self.tab == TABS[0] else f"tab {TABS.index(self.tab) + 1} {self.tab}  "
        right = f" {place}{where} "
        filtered = f" = {view.filter}" if view.filter else " = (no filter)"
        if self.awaited:
            filtered = f" = {self.awaited} (once it is judged)"
        left = padded(fit(escape(filtered), max(4, width - len(right))), width - len(right))
        return (left, NAMED["good" if view.filter else "dim"]), (fit(right, width), NAMED[""])

    def say(self, text: str, style: str = "") -> None:
        """Show a line in place of the keys until the next key; what came from a capture may stand in it."""
        self.said, self.said_style = escape(" ".join(text.split("\n"))), style
        self.draw_lines()

    def open_page(self, page: ScreenPage) -> None:
        """Show a page before the panes; a click that came late opens no second one before it."""
        if not isinstance(self.screen, ScreenPage):
            self.push_screen(page)

    def forget_said(self) -> None:
        """Show the keys again."""
        if self.said:
            self.said = ""
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
            if room < _LOW:
                sizes = {name: (room - 4 if name == used else 0) for name in sizes}
            upper = max(3, room - sum(sizes.values()))
            self.details.styles.width = self.bytes.styles.width = "100%"
        self.list.styles.height = upper
        self.lower.styles.height = max(0, room - upper)
        self.lower.display = room > upper
        for pane in (self.details, self.bytes):
            pane.styles.height = sizes[str(pane.id)]
            pane.display = sizes[str(pane.id)] > 0

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
        self.bytes.light(lit_by(self.details.line, () if self.shown is None else self.shown.frames))

    def select_by_byte(self) -> None:
        """Select the detail that speaks of the current byte."""
        shown = self.shown
        index = None if shown is None else line_at(shown.lines, shown.frames, self.bytes.at)
        if index is not None:
            self.details.select(index)

    def action_tab(self, name: str) -> None:
        """Show a tab, or the three panes."""
        self.tab = name
        self.view.supply.renew(name)
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
        if self.tab == "statistics":
            empty = "it is being added up, once everything is decoded and judged"
        if supply.doing == "following":
            anew = "" if supply.only_once() else ": ctrl+r reads and judges what there is by now"
            empty = f"not known while it is followed{anew}"
        lines = supply.tab(self.tab)
        if self.tab == "notes":
            lines = [TabLine(escape(note), "warn") for note in supply.notes]
            lines = lines or [TabLine("there is nothing to complain of", "good")]
        menu = self.tab == "statistics" and lines is None and not supply.asking
        self.tabs.take(self.tab.capitalize(), self._menu() if menu else lines, empty)

    def _menu(self) -> list[TabLine]:
        """Return the statistics that there are, to be asked for."""
        told = TabLine("enter asks for one; s for any, such as io,100ms or values,FIELD", "dim")
        line = self.details.line
        leaf = line is not None and line.bits is not None and any(map(str.isdigit, line.value))
        name = field_name(line.name, self.view.supply.registry) if leaf and line is not None else ""
        known = {**STATISTICS, "values": f"how the values of {name} are spread"} if name else STATISTICS
        asks = {one: f"values,{name}" if one == "values" and name else one for one in known if one != "values" or name}
        return [*(TabLine(f"{asks[one]:<12} {known[one]}", ask=asks[one]) for one in asks), told]
