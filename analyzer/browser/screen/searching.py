"""Find: text, bytes or a filter, the next match and the one before."""

from __future__ import annotations

from analyzer.browser.screen.walking import Walking
from analyzer.browser.search import Search, bytes_of, look_for_bytes, look_for_filter, look_for_text
from analyzer.filter.language.errors import FilterError


class Searching(Walking):
    """The part of the browser that finds."""

    def find(self, text: str) -> None:
        """Look for text, bytes or a filter, and go to the first match."""
        if self.search is not None:
            self.search.stop()
        self.search, text = None, text.strip()
        if not text:
            return
        view, row = self.view, self.view.current()
        start = 0 if row is None else row.segment
        wanted, supply = bytes_of(text), view.supply
        rule = text.upper() if text.upper() in supply.severities and supply.named is not None else ""
        if rule or text.startswith("="):
            chosen = f'finding.rule == "{rule}"' if rule else text[1:].strip()
            try:
                look = look_for_filter(view.store, view.matcher(chosen))
            except FilterError as error:
                self.fail(str(error))
                return
            self.search = Search(view.store, text, look, start, ordered=True)
        elif wanted is not None:
            self.search = Search(view.store, text, look_for_bytes(view.store, wanted), start)
        else:
            look = look_for_text(view.store, supply.registry, view.frames, view.pages.clock(), text, supply.labels)
            self.search = Search(view.store, text, look, start)
        self.search.begin()
        self.action_next(1)

    def action_next(self, step: int) -> None:
        """Go to the next match, or wait for it."""
        if self.search is None:
            self.fail("nothing is looked for: / finds")
            return
        self.wanted = step
        self.wait_for_search()

    def wait_for_search(self) -> None:
        """Go to the match that is waited for, if it is known now."""
        search = self.search
        if search is None or not self.wanted:
            return
        if search.problem is not None:
            self.wanted = 0
            self.fail(f"the search failed: {search.problem}")
            return
        segment, local = self.view.anchor or (0, -1)
        found = search.next(segment, local, self.wanted)
        if found == "wait":
            self.say(f"looking for {search.text} ... (esc ends it)")
        elif isinstance(found, str):
            where = "behind" if self.wanted > 0 else "before"
            self.wanted = 0
            self.fail(f"no match {where} this row: {search.text} ({search.count:,} in all)")
        else:
            self.wanted = 0
            if self.go_to(found, ""):
                more = "" if search.done else " so far"
                self.say(f"{search.count:,} match{'es' * (search.count != 1)}{more}: n the next, N the one before")
