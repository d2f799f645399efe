"""Moving about in the browser: rows, places, matches of a search, findings, marks."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from analyzer.browser.screen.base import BrowserBase
from analyzer.browser.search import Search, bytes_of, look_for_bytes, look_for_filter, look_for_text
from analyzer.browser.supply import TABS
from analyzer.browser.walk import counterpart, next_place, same_sender
from analyzer.filter.errors import FilterError
from analyzer.window.limits import Moment

if TYPE_CHECKING:
    from collections.abc import Sequence

_FRAME, _SHARE = re.compile(r"^#?\d+$"), re.compile(r"^(\d{1,3}(?:\.\d+)?) ?%$")


class Moving(BrowserBase):
    """The part of the browser that goes from place to place."""

    def action_move(self, by: int) -> None:
        """Go to the next row, line or byte of the pane in use."""
        self.following = False
        if self.tab != TABS[0]:
            self.tabs.move(by)
        elif self.focused is self.details:
            self.details.move(by)
        elif self.focused is self.bytes:
            self.bytes.step(by)
        else:
            self.list.move(by)

    def action_packet(self, by: int) -> None:
        """Go to the next row, whatever pane is in use."""
        self.following = False
        self.list.move(by)

    def action_sideways(self, by: int) -> None:
        """Fold or open a detail, go to the next byte, shift a tab."""
        if self.tab != TABS[0]:
            self.tabs.shift(by * 8)
        elif self.focused is self.details:
            self.details.fold(shut=by < 0)
        elif self.focused is self.bytes:
            self.bytes.move(by)
        else:
            self.list.move(by)

    def action_page(self, by: int) -> None:
        """Go a page further."""
        self.following = False
        if self.tab != TABS[0]:
            self.tabs.move(by * max(1, self.tabs.size.height - 2))
        elif self.focused is self.details:
            self.details.move(by * max(1, self.details.size.height - 2))
        elif self.focused is self.bytes:
            self.bytes.step(by * max(1, self.bytes.size.height - 1))
        else:
            self.list.move(by * self.list.page)

    def action_edge(self, by: int) -> None:
        """Go to the first or the last one; the last row follows what comes."""
        far = by * (1 << 40)
        if self.tab != TABS[0]:
            self.tabs.move(far)
        elif self.focused is self.details:
            self.details.move(far)
        elif self.focused is self.bytes:
            self.bytes.move(far)
        else:
            self.following = by > 0 and not self.view.supply.loaded
            self.list.move(far)

    def action_pane(self, by: int) -> None:
        """Use the next pane."""
        if self.tab != TABS[0]:
            self.action_tab(TABS[(TABS.index(self.tab) + by) % len(TABS)])
            return
        panes = list(self.panes)
        at = panes.index(self.focused) if self.focused in panes else 0
        pane = panes[(at + by) % len(panes)]
        pane.display = self.lower.display = True
        self.set_focus(pane)

    # ---- places

    def go_to(self, place: tuple[int, int] | None, otherwise: str) -> bool:
        """Go to a row by segment and place in it, to the nearest one if a filter hides it; say why not."""
        if place is None:
            self.fail(otherwise)
            return False
        self.following = False
        self.view.anchor = place
        if self.tab != TABS[0]:
            self.action_tab(TABS[0])
        if not len(self.view.rows):
            self.fail("no row matches the filter")
            return False
        self.list.to(self.view.number())
        if self.view.rows.at(self.view.number()) != place:
            self.say("the filter hides that row: this is the nearest one (esc takes the filter off)", "warn")
        return True

    def go_to_frame(self, frame: int) -> bool:
        """Go to the row of a frame, from 0."""
        store = self.view.store
        if not 0 <= frame < store.frames:
            more = "" if self.view.supply.loaded else " so far"
            self.fail(f"there is no frame {frame + 1:,}: frames are 1 to {store.frames:,}{more}")
            return False
        return self.go_to(store.row_of_frame(frame), f"no row shows frame {frame + 1:,}")

    def go_to_time(self, t: int) -> bool:
        """Go to the first row at a time or behind it."""
        return self.go_to(self.view.store.row_at_time(t), "the capture has no times")

    def go_where(self, text: str) -> bool:
        """Go to what was typed: a frame, a time, or a share of the capture."""
        text = text.strip()
        store = self.view.store
        if _FRAME.match(text):
            return self.go_to_frame(int(text.lstrip("#")) - 1)
        if share := _SHARE.match(text):
            number = round(len(self.view.rows) * float(share[1]) / 100)
            self.list.to(number)
            return True
        try:
            moment = Moment.parse(text)
        except ValueError as error:
            self.fail(f"{error}, nor a frame")
            return False
        if store.low is None:
            self.fail("the capture has no times")
            return False
        return self.go_to_time(moment.at(store.low))

    def begin_at(self) -> None:
        """Go where `--at` says, once that is decoded."""
        text, store = self.start, self.view.store
        if _FRAME.match(text):
            ready = int(text.lstrip("#")) <= store.frames
        else:
            try:
                ready = store.high is not None and store.high >= Moment.parse(text).at(store.low or 0)
            except ValueError:
                ready = True
        if ready or self.view.supply.loaded:
            self.start = ""
            self.go_where(text)

    def action_sender(self, step: int) -> None:
        """Go to the next transfer of the same sender and type."""
        row = self.view.current()
        if row is not None:
            self.go_to(same_sender(self.view, row, step), "no other transfer of this sender and type there")

    def action_counterpart(self) -> None:
        """Go from a request to its response, and back."""
        row = self.view.current()
        if row is None:
            return
        own = self.view.sender(row)
        if own is None or not self.view.is_service(own):
            self.fail("only requests and responses have a counterpart")
            return
        self.go_to(counterpart(self.view, row), "no answer to it is there" if own["kind"] == 2 else "nobody asked")

    def action_finding(self, step: int) -> None:
        """Go to the next place at which a finding begins."""
        supply = self.view.supply
        if supply.named is None:
            self.fail("findings are not known yet: the capture is still being judged")
            return
        self._go_to_next(supply.starts, step, "finding")

    def action_marked(self, step: int) -> None:
        """Go to the next mark."""
        self._go_to_next(sorted(self.view.marks.marks), step, "mark")

    def _go_to_next(self, places: Sequence[int], step: int, what: str) -> None:
        row = self.view.current()
        now = -1 if row is None else row.place
        own = self.view.places_of(row) if row is not None else []
        now = max(own, default=now) if step > 0 else min(own, default=now)
        target = next_place(places, now, step)
        if target is None:
            self.fail(f"no {what} {'behind' if step > 0 else 'before'} this row")
        elif self.go_to_frame(target) and what == "mark":
            self.say(self.view.marks.marks[target].text)

    # ---- search

    def find(self, text: str) -> None:
        """Look for text, bytes or a filter, and go to the first match."""
        if self.search is not None:
            self.search.stop()
        self.search, text = None, text.strip()
        if not text:
            return
        view, row = self.view, self.view.current()
        start = 0 if row is None else row.segment
        wanted = bytes_of(text)
        if text.startswith("="):
            try:
                look = look_for_filter(view.store, view.matcher(text[1:].strip()))
            except FilterError as error:
                self.fail(str(error))
                return
            self.search = Search(view.store, text, look, start, ordered=True)
        elif wanted is not None:
            self.search = Search(view.store, text, look_for_bytes(view.store, wanted), start)
        else:
            look = look_for_text(view.store, view.supply.registry, view.frames, view.pages.clock(), text)
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
