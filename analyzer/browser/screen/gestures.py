"""Gestures on the selected field or row: filters, columns, conversations, time references."""

from __future__ import annotations

import re

from analyzer.browser.conditions import combined, condition, field_name
from analyzer.browser.own_columns import OwnColumns
from analyzer.browser.screen.handing import Handing
from analyzer.browser.screen.pages.help import line_page, rule_page
from analyzer.browser.screen.styles import CONVERSATIONS
from analyzer.browser.sorted_rows import SortedRows
from analyzer.browser.supply import TABS
from analyzer.browser.walk import follow_filter
from analyzer.filter.language.errors import FilterError
from analyzer.views.times import MODES

FOLLOWS = {"n": "node", "t": "type", "e": "esc", "u": "unit", "x": "exchange"}
_FOLLOWED = {"esc": "channel of an ESC", "unit": "power unit", "exchange": "exchange of a service"}
_RULE = re.compile(r'finding\.rule == "([^"]+)"')
_HOW = {"s": "", "n": "not", "a": "and", "o": "or", "b": "and not", "c": "or not"}
ASKS = {
    "go": "go to a frame (4711), a time (12.5 or 12:49:54.89) or 50%",
    "find": "find text, bytes (0a ff), or = and a filter; tab completes",
    "filter": "a filter; tab completes, up: older ones, esc leaves",
    "comment": "a comment on this row; empty takes it off",
    "write": "a .log, .pcapng, .mcap, .jsonl, .csv or .parquet",
    "statistic": "talkers, nodes, services, load, io,100ms, values,FIELD; tab: all",
}


class Gestures(Handing):
    """The part of the browser that makes filters and columns of what is selected."""

    def _selected_filter(self) -> str:
        """Return the filter that stands for what is selected: a line of a tab, or a detail."""
        if self.tab != TABS[0]:
            chosen = self.tabs.line
            return "" if chosen is None else chosen.filter
        line = self.details.line
        if self.shown is None or line is None:
            return ""
        return condition(line, self.view.supply.registry, self.shown.batch)

    def action_apply(self, how: str) -> None:
        """Apply what is selected as filter."""
        new = self._selected_filter()
        if not new:
            self.fail("nothing that a filter knows is selected: tab goes to the details")
            return
        self.set_filter(combined(self.view.filter, new, how))

    def action_prepare(self, how: str) -> None:
        """Put what is selected into the filter line."""
        new = self._selected_filter()
        if not new:
            self.fail("nothing that a filter knows is selected: tab goes to the details")
            return
        self.ask("filter", combined(self.view.filter, new, how))

    def set_filter(self, text: str) -> bool:
        """Show only what a filter selects; say where it is wrong."""
        try:
            self.awaited = text if self.view.waits(text) else ""
            if not self.awaited:
                self.view.apply(text)
        except FilterError as error:
            self.say_place(error)
            return False
        self.bar.ask("filter", "")
        self.bar.keep(text)
        if text:
            self.tools.keep_filter(text)
        if self.tab != TABS[0]:
            self.action_tab(TABS[0])
        self.list.draw()
        self.show_row()
        if self.awaited:
            self.say("it is applied once the capture is judged (esc forgets it)")
        self.draw_lines()
        return True

    def wait_for_findings(self) -> None:
        """Apply the filter that waits for findings, if they are known now."""
        if self.awaited and not self.view.waits(self.awaited) and self.set_filter(self.awaited):
            self.forget_said()  # that it is waited for

    def say_place(self, error: FilterError) -> None:
        """Say what is wrong with a filter; the cursor of the filter line is the caret."""
        self.ask("filter", error.text)
        self.bar.cursor_position = error.start
        wrong = error.text[error.start : error.end]
        caret = f"{' ' * error.start}{'^' * max(1, len(wrong))}"
        fits = len(caret) + len(error.reason) + 3 < self.size.width
        self.fail(f"{caret} {error.reason}" if fits else f"^ {wrong}: {error.reason}")

    def action_clear(self) -> None:
        """End a search or a selection, go back to the list; there take the order, then the filter off."""
        if self.end_walk():
            self.say("it is looked for no more")
        elif self.awaited:
            self.awaited = ""
            self.say("the filter that waited is forgotten")
        elif self.search is not None:
            self.search.stop()
            self.search, self.wanted = None, 0
            self.say("the search has ended")
        elif self.view.begun is not None:
            self.action_select(0)
        elif self.tab != TABS[0]:
            self.action_tab(TABS[0])
        elif self.focused is not self.list:
            self.set_focus(self.list)
        elif isinstance(self.view.rows, SortedRows):
            self.view.sort("")
            self.list.to(self.view.number())
            self.say("rows are in the order of the capture")
        elif self.view.filter:
            self.set_filter("")

    def action_combine(self, chord: str) -> None:
        """Ask how what is selected becomes a filter."""
        self.chord = chord
        self.say(f"{chord}: s selected  n not selected  a and  o or  b and not  c or not", "bold")

    def combine(self, chord: str, key: str) -> None:
        """Apply or prepare what is selected, together with the filter that is there."""
        how = _HOW.get(key)
        if how is None:
            self.say(f"nothing to {chord}")
        elif chord == "apply":
            self.action_apply(how)
        else:
            self.action_prepare(how)

    def action_follow(self) -> None:
        """Ask what to follow."""
        self.chord = "follow"
        self.say("follow: n node  t its type  e ESC (channel)  u power unit  x service exchange", "bold")

    def follow(self, key: str) -> None:
        """Filter by what a row is part of."""
        row, what = self.view.current(), FOLLOWS.get(key)
        if row is None or what is None:
            self.say("nothing is followed")
            return
        text = follow_filter(self.view, row, what)
        if not text:
            self.fail(f"this row names no {_FOLLOWED.get(what, what)}: n follows its node")
            return
        if self.set_filter(text):
            self.say(f"following {text} (esc shows all)")

    def action_column(self, by: int) -> None:
        """Show the selected field as a column, or take the last one off."""
        columns = self.view.pages.columns
        names = [] if columns is None else list(columns.names)
        if by < 0:
            names = names[:-1]
        else:
            line = self.details.line
            name = "" if line is None else field_name(line.name, self.view.supply.registry)
            if not name or name in names:
                self.fail("this line is no field" if not name else f"{name} is a column already")
                return
            names.append(name)
        self.set_columns(names)

    def set_columns(self, names: list[str]) -> None:
        """Show fields as columns; say why not."""
        try:
            made = OwnColumns(self.view.store, self.view.supply.registry, names) if names else None
        except (LookupError, ValueError) as error:
            self.fail(f"no column: {error}")
            return
        self.view.pages.columns = made
        self.tools.keep_columns(names)
        self.list.forget()

    def action_conversation(self) -> None:
        """Colour the rows of this conversation, or no more."""
        row, some = self.view.current(), self.list.conversations
        own = None if row is None else self.view.conversation_of(row)
        if own is None:
            self.fail("only transfers are of a conversation")
            return
        if own in some:
            some.remove(own)
        else:
            some[:] = [*some[-len(CONVERSATIONS) + 1 :], own]
        self.list.draw()
        who = " and ".join(f"node {node}" for node in sorted(own))
        self.say(f"{'coloured' if own in some else 'not coloured any more'}: {who}")

    def action_numbers(self) -> None:
        """Show types and fields by numbers in place of names, or again by names."""
        pages = self.view.pages
        pages.numbers = not pages.numbers
        self.list.forget()
        self.say("numbers: IDs of types, fields as they are" if pages.numbers else "names of types, words for values")

    def action_reference(self) -> None:
        """Count times from this row, or again from the first frame."""
        row = self.view.current()
        t = None if row is None else self.view.store.time(row)
        pages = self.view.pages
        pages.zero = None if t is None or pages.zero == t else t
        self.list.forget()
        self.show_row()
        self.say("times count from this row" if pages.zero is not None else "times count from the first frame")

    def action_times(self) -> None:
        """Show times in the next way."""
        pages, modes = self.view.pages, ("r", "a", "ad", "d", "dd", "e", "u", "ud")
        pages.mode = modes[(modes.index(pages.mode) + 1) % len(modes)]
        self.list.forget()
        self.show_row()
        self.say(f"-t {pages.mode}: {MODES[pages.mode]}")

    def action_choose(self) -> None:
        """Go from a row to its details, fold a detail; go where a line of a tab leads to, or apply its filter."""
        if self.tab == TABS[0]:
            self._choose_in_panes()
            return
        line = self.tabs.line
        if line is None:
            return
        if line.ask:
            self.statistic(line.ask)
        elif line.frame is not None:
            self.go_to_frame(line.frame)
        elif self.tab == "statistics" and line.filter:
            self.set_filter(line.filter)
        elif line.t is not None:
            self.go_to_time(line.t)
        elif line.filter:
            self.set_filter(line.filter)

    def _choose_in_panes(self) -> None:
        if self.focused is self.list:
            self.action_pane(1)
        elif self.focused is self.details and self.details.cut:
            self.open_page(line_page(self.details.line.text if self.details.line else "", self.size.width))
        elif self.focused is self.details:
            self.details.fold()

    def statistic(self, text: str) -> None:
        """Ask for a statistic, and show its tab."""
        wrong = self.view.supply.ask(text)
        if wrong:
            self.fail(wrong)
        else:
            self.action_tab("statistics")

    def action_explain(self) -> None:
        """Show the page of the rule that the current line or row is about."""
        row = self.view.current()
        found = _RULE.search(self.tabs.line.filter) if self.tab == "findings" and self.tabs.line else None
        rules = [found[1]] if found else [] if row is None else self.view.rules_of(row)
        page = self.view.supply.explain(rules[0], self.size.width - 2) if rules else ""
        if not page:
            self.fail("no rule names this row" if not rules else f"{rules[0]} has no page so far")
            return
        self.open_page(rule_page(page))
        if len(rules) > 1:
            self.say(f"this row is named by {', '.join(rules)}")

    def action_fold_all(self) -> None:
        """Fold all details, or open them."""
        self.details.fold_all(shut=not self.details.folded)

    def ask(self, purpose: str, value: str = "") -> None:
        """Ask for something in the line."""
        self.bar.ask(purpose, value)
        self.bar.display, self.state.display = True, False
        self.set_focus(self.bar)
        self.say(f"{purpose}: {ASKS[purpose]}", "dim")
