"""The line that is typed in: text is asked for, checked as it comes, and done."""

from __future__ import annotations

from analyzer.browser.screen.gestures import ASKS, Gestures
from analyzer.browser.supply import TABS
from analyzer.filter.compiled import compile_filter
from analyzer.filter.language.errors import FilterError


class Asking(Gestures):
    """The part of the browser that asks for text."""

    _checked = ""

    def check_typed(self) -> None:
        """Show by its colour whether what is typed is a filter by now."""
        text = self.bar.value.strip() if self.bar.display and self.bar.purpose == "filter" else ""
        if text == self._checked:
            return
        self._checked, good = text, True
        try:
            if text:
                compile_filter(text, self.view.supply.registry)
        except FilterError:
            good = False
        self.bar.set_class(bool(text) and good, "good")
        self.bar.set_class(not good, "bad")

    def action_ask(self, purpose: str) -> None:
        """Ask for something in the line."""
        self.ask(purpose)

    def action_ask_go(self) -> None:
        """Ask where to go."""
        self.ask("go")

    def action_ask_find(self) -> None:
        """Ask what to find."""
        self.ask("find")

    def action_ask_filter(self) -> None:
        """Ask for a filter."""
        self.ask("filter", self.view.filter)

    def action_ask_comment(self) -> None:
        """Ask for a comment."""
        places = self.frames_now()
        marks, remarks = self.view.marks.marks, self.view.supply.remarks
        own = (marks[place].text for place in places if place in marks)
        self.ask("comment", next(own, "") or next((remarks[place] for place in places if place in remarks), ""))

    def action_ask_write(self) -> None:
        """Ask for a file."""
        self.ask("write")
        view = self.view
        what = f"{len(view.selected()):,} selected rows" if view.begun is not None else f"all {len(view.rows):,} rows"
        self.say(f"write {what} to {ASKS['write']}", "dim")

    def action_ask_statistic(self) -> None:
        """Ask for a statistic."""
        self.ask("statistic")

    def leave_bar(self) -> None:
        """Go back to the panes."""
        self._unasked()
        self.say("")

    def _unasked(self) -> None:
        self.bar.display, self.state.display = False, True
        self.set_focus(self.list if self.tab == TABS[0] else self.tabs)

    def submit(self) -> None:
        """Do what was asked for."""
        purpose, text = self.bar.purpose, self.bar.value.strip()
        self.bar.keep(text)
        self._unasked()
        self.say("")
        if purpose == "filter":
            self.set_filter(text)
        elif purpose == "find":
            self.find(text)
        elif purpose == "go" and text:
            self.go_where(text)
        elif purpose == "comment":
            self.comment(text)
        elif purpose == "write" and text:
            self.write(text)
        elif purpose == "statistic" and text:
            self.statistic(text)
