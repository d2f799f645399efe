"""The packet list: as many rows as fit, of as many as there are."""

from __future__ import annotations

from collections import OrderedDict
from typing import TYPE_CHECKING

from textual.message import Message

from analyzer.browser.screen.lines import RIGHT, Pane, padded
from analyzer.browser.screen.styles import CONVERSATIONS, NAMED, PLAIN, of_codes
from analyzer.views.terminal import ELLIPSIS, fit

if TYPE_CHECKING:
    from rich.style import Style
    from textual import events

    from analyzer.browser.listed import ListLine
    from analyzer.browser.screen.lines import Spans
    from analyzer.browser.view import BrowserView

_KEPT = 1000  # lines that are written already
_BESIDE = 1  # column of the marks
_RULE = "Rule"
_LEAST_INFO = 12  # columns that what a row says keeps from the rules
_ORDER = ("error", "warning", "note")
_STYLES = ("bad", "warn", "dim")
_SIGNS = ("!", "?", "")  # as in the strip


class PacketList(Pane, can_focus=True):
    """Shows the rows of a view around the one that it is at."""

    class Moved(Message):
        """Another row is the current one."""

    class Asked(Message):
        """The current row was clicked with the right button, in a column."""

        def __init__(self, column: str) -> None:
            super().__init__()
            self.column = column

    class Sorted(Message):
        """The name of a column was clicked."""

        def __init__(self, column: str, *, right: bool) -> None:
            super().__init__()
            self.column, self.right = column, right

    def __init__(self, view: BrowserView) -> None:
        super().__init__("list")
        self._view = view
        self._top = 0
        self._kept: OrderedDict[tuple[int, int], ListLine] = OrderedDict()
        self._made: tuple[object, ...] = ()
        self.conversations: list[frozenset[int]] = []

    @property
    def page(self) -> int:
        """How many rows are seen."""
        return max(1, self.size.height - 1)

    def move(self, by: int) -> None:
        """Go so many rows further."""
        self.to(self._view.number() + by)

    def to(self, number: int) -> None:
        """Go to a row."""
        self._view.go(number)
        self.draw()
        self.post_message(self.Moved())

    def extend(self, by: int) -> None:
        """Select rows so much further, from the current one on if none are."""
        if self._view.begun is None:
            self._view.begun = self._view.anchor
        self.move(by)

    def forget(self) -> None:
        """Write all lines anew: what they show has changed."""
        self._kept.clear()
        self.draw()

    def draw(self) -> None:
        """Draw the rows that are seen."""
        view, width, height = self._view, self.size.width, self.size.height
        if not width or height < 1:
            return
        rows, at = view.rows, view.number()
        count = len(rows)
        if not self._top - self.page <= at < self._top + 2 * self.page:
            self._top = at - self.page // 2  # what was jumped to stands amid its neighbours
        self._top = max(0, min(self._top, at, count - self.page), at - self.page + 1)
        numbers = range(self._top, min(self._top + self.page, count))
        places = [rows.at(number) for number in numbers]
        made = (width, view.pages.mode, view.pages.zero, view.pages.columns, view.store.buses)
        if made != self._made or view.pages.mode == "dd":
            self._kept.clear()
            self._made = made
        lines = self._lines(places, list(numbers), width - _BESIDE)
        marked = self._marked(places)
        style = NAMED["title" if self.has_focus else "head"]
        head = padded(" " + view.pages.head(width - _BESIDE), width)
        if view.supply.named is not None and self._spare(width) >= len(_RULE):
            head = f"{head[: width - len(_RULE) - 1]} {_RULE}"
        shown: list[Spans] = [((head, style),)]
        selected = range(0) if view.begun is None else view.selected()
        for number, place, (sign, rules), line in zip(numbers, places, marked, lines, strict=True):
            colour = self._conversation(place)
            own = of_codes(line.codes) if line.codes else NAMED["bad"] if line.broken else PLAIN
            if colour and not line.codes:
                own += CONVERSATIONS[colour - 1]
            if number in selected:
                own += NAMED["selected"]
            if number == at:
                own = NAMED["focus"] + (own if not line.codes else of_codes(line.codes))
            beside = ">" if number in selected else str(colour) if colour and sign in " *" else sign
            shown.append(((beside, NAMED["good"]), *self._with_rules(line.text, rules, width - _BESIDE, own)))
        if not count:
            shown.append(((padded(f"  {self._nothing()}", width), NAMED["dim"]),))
        self.put(shown)

    def _with_rules(self, text: str, rules: list[str], width: int, style: Style) -> Spans:
        """Return a row with the worst rule that names it at its right end, as much of it as there is room for."""
        if not rules:
            return ((padded(text, width), style),)
        severities = self._view.supply.severities
        grade, worst = min((_ORDER.index(severities.get(rule, _ORDER[-1])), rule) for rule in rules)
        sign, more = _SIGNS[grade], f"+{len(rules) - 1}" if len(rules) > 1 else ""
        spare = self._spare(width)
        told = next(
            (one for one in (f" {sign}{worst}{more}", f" {sign}{worst}") if len(one) <= spare), f" {sign}".rstrip()
        )
        room = max(0, width - len(told))
        own = style if style.reverse else NAMED[_STYLES[grade]]
        body = fit(text, room)
        return (padded(body.rstrip(ELLIPSIS) + ELLIPSIS if body.endswith(ELLIPSIS) else body, room), style), (told, own)

    def _spare(self, width: int) -> int:
        """Return how many columns what rows say leaves to rules."""
        return width - self._view.pages.info - _LEAST_INFO

    def _nothing(self) -> str:
        view = self._view
        if view.filter:
            done = getattr(view.rows, "done", True)
            return f"no row matches {view.filter}" if done else "no row matches so far"
        return "nothing is decoded yet" if not view.supply.loaded else "the capture holds no frame"

    def _lines(self, places: list[tuple[int, int]], numbers: list[int], width: int) -> list[ListLine]:
        view = self._view
        lacking = [k for k, place in enumerate(places) if place not in self._kept]
        if lacking:
            some = [view.store.row(*places[k]) for k in lacking]
            before = [self._before(places[k], numbers[k]) for k in lacking]
            for k, line in zip(lacking, view.pages.lines(some, width, before), strict=True):
                self._kept[places[k]] = line
        found = [self._kept[place] for place in places]
        while len(self._kept) > max(_KEPT, 2 * len(places)):
            self._kept.popitem(last=False)
        return found

    def _before(self, place: tuple[int, int], number: int) -> int | None:
        """Return the time of the row that a delta is counted from."""
        view = self._view
        if view.pages.mode == "dd":
            return view.store.time(view.row(number - 1)) if number > 0 else None
        if view.pages.mode == "d":
            whole = view.store.starts[place[0]] + place[1]
            return view.store.time(view.store.row(*view.store.locate(whole - 1))) if whole > 0 else None
        return None

    def _marked(self, places: list[tuple[int, int]]) -> list[tuple[str, list[str]]]:
        """Return the sign in front of each row - a mark, a comment, a rule, an event -, and the rules that name it."""
        view, marks, remarks = self._view, self._view.marks.marks, self._view.supply.remarks
        found = []
        named, events = view.supply.named, view.supply.places
        known = marks or events or remarks or named is not None
        for place in places:
            row = view.store.row(*place)
            frames = view.places_of(row) if known else []
            rules = view.rules_of(row)
            own = [marks[frame] for frame in frames if frame in marks]
            sign = " "
            if any(mark.text for mark in own) or any(frame in remarks for frame in frames):
                sign = "c"
            elif own:
                sign = "m"
            elif rules:
                sign = "*"
            elif any(frame in events for frame in frames):
                sign = "e"
            found.append((sign, rules))
        return found

    def _conversation(self, place: tuple[int, int]) -> int:
        """Return the number of the coloured conversation that a row is part of, from 1; 0 for none."""
        if not self.conversations:
            return 0
        own = self._view.conversation_of(self._view.store.row(*place))
        return self.conversations.index(own) + 1 if own is not None and own in self.conversations else 0

    def on_mouse_down(self, event: events.MouseDown) -> None:
        """Go to a row; with shift select all rows up to it."""
        number = self._top + event.y - 1
        if event.y < 1:
            column = self._view.pages.column_at(event.x - _BESIDE)
            self.post_message(self.Sorted(column, right=event.button == RIGHT))
            return
        if number >= len(self._view.rows):
            return
        if event.button == RIGHT:
            self._view.go(number)
            self.draw()
            self.post_message(self.Asked(self._view.pages.column_at(event.x - _BESIDE)))
        elif event.shift:
            self.extend(number - self._view.number())
        else:
            self._view.begun = None
            self.to(number)

    def on_mouse_scroll_down(self, _: events.MouseScrollDown) -> None:
        """Go on."""
        self.move(3)

    def on_mouse_scroll_up(self, _: events.MouseScrollUp) -> None:
        """Go back."""
        self.move(-3)
