"""The part of the browser that offers what can be done here: in a menu, and by clicks on the names of columns."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from analyzer.browser.conditions import field_name
from analyzer.browser.screen.asking import Asking
from analyzer.browser.screen.gestures import FOLLOWS
from analyzer.browser.screen.pages.menu import MenuEntry, MenuPage
from analyzer.browser.sorted_rows import SortedRows
from analyzer.browser.supply import TABS
from analyzer.browser.walk import follow_filter
from analyzer.filter.language.errors import FilterError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.browser.screen.list_pane import PacketList
    from analyzer.browser.store.store import ListRow

_WAYS = (
    ("a", "apply as filter", "apply('')"), ("", "apply as filter: not", "apply('not')"), ("&", "and", "apply('and')"),
    ("|", "or", "apply('or')"), ("!", "and not", "apply('and not')"), ("p", "prepare as filter", "prepare('')"),
)  # fmt: skip
_COPIED = (
    ("yv", "the value"), ("yf", "as a filter"), ("yt", "the row as text"), ("yj", "the row as JSON"),
    ("yc", "its frames as candump lines"), ("yd", "all details"), ("yb", "its bytes"),
)  # fmt: skip
# What is sorted by where the name of a column is clicked; the list as it was recorded for those of no field.
_SORTS = {"src": "dronecan.src", "dst": "dronecan.dst", "type": "dronecan.type_id", "id": "dronecan.transfer_id"}

_TYPE = re.compile(r"[A-Z]\w*")  # a name of no field


class Offering(Asking):
    """Offers the gestures on what is selected, and sorts."""

    _unsorted: SortedRows | None = None  # what is being sorted

    def action_menu(self) -> None:
        """Offer what can be done with what is selected."""
        entries = list(self._tab_entries() if self.tab != TABS[0] else self._entries())
        if not entries:
            self.fail("nothing is selected that something can be done with")
            return
        self.open_page(MenuPage(self._menu_title(), entries))

    def _menu_title(self) -> str:
        if self.tab != TABS[0]:
            return self.tabs.title
        line, row = self.details.line, self.view.current()
        frame = "" if row is None else f"frame {row.place + 1}"
        return frame if line is None else f"{frame}: {line.text.strip()}"

    def _tab_entries(self) -> Iterator[MenuEntry]:
        line = self.tabs.line
        if line is None:
            return
        if line.frame is not None or line.t is not None or line.ask:
            yield MenuEntry("enter", "ask for it" if line.ask else "go there", "choose")
        if line.filter:
            for keys, words, action in _WAYS:
                yield MenuEntry(keys, f"{words}  {line.filter}", action)
        if self.tab == "findings" and line.filter:
            yield MenuEntry("E", "the page of its rule", "explain")
        yield MenuEntry("yl", "copy the line", "copy_as('l')")

    def _entries(self) -> Iterator[MenuEntry]:
        view, row, line = self.view, self.view.current(), self.details.line
        if row is None:
            return
        if new := self._selected_filter():
            for keys, words, action in _WAYS:
                yield MenuEntry(keys, f"{words}  {new}" if keys in ("a", "p") else words, action)
        if name := self._selected_name():
            yield MenuEntry("i", f"as a column  {name}", "column(1)")
            yield MenuEntry("S", f"sort by it; again: the highest first, as recorded  {name}", "sort")
            yield MenuEntry("", f"statistic: how its values are spread  {name}", f"values('{name}')")
        for key, what in FOLLOWS.items():
            if text := follow_filter(view, row, what):
                yield MenuEntry(f"f{key}", f"follow {what}  {text}", f"follow_as('{key}')")
        yield from self._row_entries(row)
        for keys, words in _COPIED if line is not None else ():
            yield MenuEntry(keys, f"copy {words}", f"copy_as('{keys[1]}')")
        yield MenuEntry("w", "write what is selected or displayed to a file", "ask_write")
        yield MenuEntry("o", "the picture around it, in Rerun", "plot")

    def _row_entries(self, row: ListRow) -> Iterator[MenuEntry]:
        """Yield what can be done with the row itself."""
        view = self.view
        if view.conversation_of(row) is not None:
            yield MenuEntry("c", "colour its conversation, or no more", "conversation")
        own = view.sender(row)
        if own is not None and view.is_service(own):
            yield MenuEntry("r", "go from request to response, and back", "counterpart")
        if rules := view.rules_of(row):
            yield MenuEntry("E", f"the page of {', '.join(rules)}", "explain")
        yield MenuEntry("m", "mark it, or take the mark off", "mark")
        yield MenuEntry("M", "a comment on it", "ask_comment")
        yield MenuEntry("t", "count times from here", "reference")

    def _selected_name(self) -> str:
        """Return the field that the selected detail names, empty for none, or for a type, which has no value."""
        line = self.details.line
        name = "" if line is None else field_name(line.name, self.view.supply.registry)
        return "" if _TYPE.fullmatch(name) else name

    def action_copy_as(self, key: str) -> None:
        """Copy in one of several forms."""
        self.copy(key)

    def action_follow_as(self, key: str) -> None:
        """Follow what a row is part of."""
        self.follow(key)

    def action_values(self, name: str) -> None:
        """Ask how the values of a field are spread."""
        self.statistic(f"values,{name}")

    # ---- sorted

    def action_sort(self) -> None:
        """Sort by the selected field, then the other way round, then not any more."""
        name = self._selected_name()
        now = self.view.rows
        if not name and not isinstance(now, SortedRows):
            self.fail("no field is selected to sort by: tab goes to the details; or click the name of a column")
            return
        self.sort_by(name)

    def sort_by(self, name: str) -> None:
        """Sort by a field; by the same one the other way round, and then as it was recorded."""
        now = self.view.rows
        falling = isinstance(now, SortedRows) and now.name == name and not now.falling
        again = isinstance(now, SortedRows) and now.name == name and now.falling
        try:
            self.view.sort("" if again else name, falling=falling)
        except FilterError:
            self.fail(f"{name} has no order: only numbers are sorted")
            return
        except ValueError as error:
            self.fail(str(error))
            return
        self._unsorted = self.view.order
        self.say("rows are in the order of the capture" if self._unsorted is None else f"sorting by {name} ...")
        self.list.draw()
        self.wait_for_order()

    def wait_for_order(self) -> None:
        """Show the first rows of a sorted list, if it is sorted now."""
        order = self._unsorted
        if order is None or not order.done:
            return
        self._unsorted = None
        if order is self.view.order:
            self.remember()
            self.list.to(0)
            self.say(f"sorted by {order.name}, the {'highest' if order.falling else 'lowest'} first (esc: as recorded)")

    def on_packet_list_sorted(self, event: PacketList.Sorted) -> None:
        """Sort by the column whose name was clicked; take it off by the right button, if it is one of one's own."""
        columns = self.view.pages.columns
        if event.right:
            names = [] if columns is None else [name for name in columns.names if name != event.column]
            if columns is not None and len(names) < len(columns.names):
                self.set_columns(names)
            return
        self.sort_by(_SORTS.get(event.column, event.column if "." in event.column else ""))

    # ---- a click with the right button

    def on_packet_list_asked(self, event: PacketList.Asked) -> None:
        """Offer what can be done with the column that was clicked."""
        self.show_row()
        wanted = _SORTS.get(event.column, event.column)
        for k, line in enumerate(() if self.shown is None else self.shown.lines):
            kind = wanted == "dronecan.type_id" and not line.depth and line.name[:1].isupper()
            if kind or (line.name and field_name(line.name, self.view.supply.registry) == wanted):
                self.details.select(k)
                break
        self.action_menu()

    def on_detail_pane_asked(self) -> None:
        """Offer what can be done with a detail."""
        self.action_menu()

    def on_tab_pane_asked(self) -> None:
        """Offer what can be done with a line of a tab."""
        self.action_menu()
