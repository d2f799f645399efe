"""The monitor on a terminal: asks the feed for its state a few times a second, and hands keys on to it."""

from __future__ import annotations

from time import monotonic, monotonic_ns
from typing import TYPE_CHECKING, ClassVar, TypeVar

from textual.app import App
from textual.binding import Binding

from analyzer.terminal.bar import bottom, top
from analyzer.terminal.bus_tables import buses, nodes
from analyzer.terminal.device_table import SHOWN, devices
from analyzer.terminal.event_tables import findings, latched
from analyzer.terminal.heights import share
from analyzer.terminal.help import Help
from analyzer.terminal.pane import TablePane, TextLines
from dissectors.kit import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable

    from textual.app import ComposeResult

    from analyzer.board.snapshot import Snapshot
    from analyzer.terminal.feed import Feed
    from analyzer.terminal.sheet import TextTable

_Answer = TypeVar("_Answer")

PERIOD = 0.2  # seconds between two looks at the feed
_MESSAGE = 6.0  # seconds that a line is shown in place of the keys
PANES = ("buses", "devices", "nodes", "findings", "latched")
_PANE_KEYS = {"b": "buses", "n": "nodes", "f": "findings", "l": "latched"}
_SCROLLS = {"up": -1, "down": 1, "k": -1, "j": 1, "home": -(1 << 20), "end": 1 << 20}


class Monitor(App[None]):
    """Draws what a feed gives. Nothing is asked before it quits."""

    CSS: ClassVar[str] = "Screen { layout: vertical; overflow: hidden; } TextLines { height: 1; } Pane { height: 3; }"
    ENABLE_COMMAND_PALETTE: ClassVar[bool] = False
    AUTO_FOCUS: ClassVar[str | None] = "#devices"
    BINDINGS: ClassVar[list[Binding]] = [  # type: ignore[assignment]  # Textual allows more kinds
        Binding("space", "pause"),
        Binding("s", "sort(False)"),
        Binding("S,upper_s", "sort(True)"),
        Binding("x", "values"),
        Binding("m", "tell('mark')"),
        Binding("c", "tell('clear')"),
        Binding("w", "tell('save')"),
        Binding("e", "devices"),
        Binding("v", "browse"),
        *(Binding(key, f"pane('{pane}')") for key, pane in _PANE_KEYS.items()),
        *(Binding(key, f"scroll({by})", priority=True) for key, by in _SCROLLS.items()),
        Binding("pageup", "page(-1)", priority=True),
        Binding("pagedown", "page(1)", priority=True),
        Binding("question_mark,h,f1", "help"),
        Binding("ctrl+l", "redraw", priority=True),
        Binding("q,ctrl+c,ctrl+q", "leave", priority=True),
    ]

    def __init__(self, feed: Feed) -> None:
        super().__init__(ansi_color=True)
        self.theme = "ansi-dark"
        self.problem: Exception | None = None
        self._feed = feed
        self._kind, self._values = 0, 0
        self._snapshot: Snapshot | None = None
        self._newest: Snapshot | None = None
        self._paused: int | None = None
        self._message, self._until = "", 0.0
        self._top, self._bottom = TextLines("top"), TextLines("bottom")
        self._panes = {name: TablePane(name) for name in PANES}

    def compose(self) -> ComposeResult:
        """Lay out the first line, the panes, the last line."""
        yield self._top
        yield from self._panes.values()
        yield self._bottom

    def on_mount(self) -> None:
        """Begin to look at the feed."""
        self.app_resume_signal.subscribe(self, lambda _: self.action_redraw())
        self.set_interval(PERIOD, self.look)
        self.call_after_refresh(self.look)

    def look(self) -> None:
        """Take and draw the newest state."""
        if self._feed.ended:
            self.exit()
            return
        self._newest = self._ask(self._feed.snapshot)
        if self._paused is None:
            self._snapshot = self._newest
        self.draw()

    def draw(self) -> None:
        """Draw everything that changed."""
        snapshot = self._snapshot
        if snapshot is not None:
            for name, sheet in self._sheets(snapshot):
                self._panes[name].take(sheet)
            self._share()
        self._lines()

    def on_resize(self) -> None:
        """Share the lines anew; what stands on the terminal is not known, even if it has the size of before again."""
        self.action_redraw()
        self.call_after_refresh(self.draw)

    def on_descendant_focus(self) -> None:
        """Give the pane in use what it needs."""
        self.call_after_refresh(self.draw)

    def action_pause(self) -> None:
        """Stop the display, or let it go on."""
        self._paused = monotonic_ns() if self._paused is None else None
        self.look()

    def action_sort(self, reverse: bool) -> None:
        """Sort the pane in use."""
        self._used().sort(reverse=reverse)

    def action_values(self) -> None:
        """Show values now, lowest, or highest."""
        self._values = (self._values + 1) % len(SHOWN)
        self.draw()

    def action_tell(self, action: str) -> None:
        """Do an action of the feed; show what it says."""
        said = self._ask(getattr(self._feed, action)) or ""
        self._message, self._until = said, monotonic() + _MESSAGE if said else 0.0
        self.look()

    def action_devices(self) -> None:
        """Go to the devices; if they are in use already, to those of the next kind."""
        pane = self._panes["devices"]
        if pane.has_focus:
            self._kind += 1
        self.set_focus(pane)
        self.draw()

    def action_pane(self, name: str) -> None:
        """Go to a pane."""
        self.set_focus(self._panes[name])

    def action_scroll(self, by: int) -> None:
        """Show other rows of the pane in use."""
        self._used().scroll_rows(by)

    def action_page(self, by: int) -> None:
        """Show other rows, a page further."""
        pane = self._used()
        pane.scroll_rows(by * max(1, pane.size.height - 1))

    def action_help(self) -> None:
        """Show what keys mean."""
        if not isinstance(self.screen, Help):
            self.push_screen(Help())

    def action_redraw(self) -> None:
        """Draw everything anew: others may have written onto the terminal."""
        self.refresh(repaint=True, layout=True)

    def action_browse(self) -> None:
        """Make room for what shows row by row what comes from now on."""
        self._ask(self._feed.browse)
        self.exit()

    def action_leave(self) -> None:
        """End the session."""
        self._ask(self._feed.stop)
        self.exit()

    def _sheets(self, snapshot: Snapshot) -> list[tuple[str, TextTable]]:
        made = (
            buses(snapshot), devices(snapshot, self._kind, SHOWN[self._values]), nodes(snapshot), findings(snapshot),
            latched(snapshot),
        )  # fmt: skip
        return list(zip(PANES, made, strict=True))

    def _share(self) -> None:
        wanted = {name: pane.rows for name, pane in self._panes.items()}
        for name, height in share(self.size.height - 2, wanted, self._used().id or "").items():
            pane = self._panes[name]
            if pane.styles.height is None or pane.styles.height.value != height:
                pane.styles.height = height
                pane.display = height > 0

    def _lines(self) -> None:
        width = self.size.width
        paused = None if self._paused is None else monotonic_ns() - self._paused
        self._top.show([top(self._newest, paused, width)])
        self._bottom.show([bottom(self._told(), width)])

    def _told(self) -> str:
        """Return what an action said, or the newest note of the session, as long as they are new."""
        if monotonic() < self._until:
            return self._message
        if self._newest is not None and self._newest.notes:
            t, text = self._newest.notes[0]
            if self._newest.now - t < _MESSAGE * SECOND:
                return text
        return ""

    def _used(self) -> TablePane:
        return next((pane for pane in self._panes.values() if pane.has_focus), self._panes["devices"])

    def _ask(self, question: Callable[[], _Answer]) -> _Answer | None:
        """Ask the feed; what goes wrong there ends the monitor, and `run` raises it."""
        try:
            return question()
        except Exception as error:  # noqa: BLE001 - whatever it is, the terminal is to be left in order
            self.problem = error
            self.exit()
            return None
