"""Moving about in the browser: rows, lines, bytes, and places that are named."""

from __future__ import annotations

import re

from analyzer.browser.screen.base import BrowserBase
from analyzer.browser.supply import TABS
from analyzer.window.limits import Moment

_FRAME, _SHARE = re.compile(r"^#?\d+$"), re.compile(r"^(\d{1,3}(?:\.\d+)?) ?%$")


_MOST_KEPT = 200  # places on the way back


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

    def action_select(self, by: int) -> None:
        """Select this row and those that are gone to from here; the same key again ends that. By a step goes there."""
        self.following = False
        view = self.view
        if by:
            self.list.extend(by)
            return
        view.begun = view.anchor if view.begun is None else None
        self.list.draw()
        self.draw_lines()
        self.say("from here on: move, then y copies, w writes, v or esc ends" if view.begun else "nothing is selected")

    def action_select_all(self) -> None:
        """Select all rows that are displayed."""
        if self.tab == TABS[0] and len(self.view.rows):
            self.following = False
            self.list.move(-1 << 40)
            self.list.extend(1 << 40)
            self.say(f"{len(self.view.selected()):,} rows are selected: y copies, w writes, m marks, esc ends")

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

    def remember(self) -> None:
        """Remember where one is, for the way back."""
        place = self.view.anchor
        if place is not None and place != (self._back[-1] if self._back else None):
            self._back[:] = [*self._back[-_MOST_KEPT:], place]
        self._ahead.clear()

    def action_history(self, by: int) -> None:
        """Go back to where one was before a jump, or forward again."""
        source, other = (self._back, self._ahead) if by < 0 else (self._ahead, self._back)
        now = self.view.anchor
        while source and source[-1] == now:
            source.pop()
        if not source or now is None:
            self.fail("this is where it began" if by < 0 else "nothing to go forward to")
            return
        place = source.pop()
        kept = list(self._back), list(self._ahead)
        self.go_to(place, "")
        self._back[:], self._ahead[:] = kept
        other.append(now)

    def action_strip(self, by: int) -> None:
        """Go a column of the strip further."""
        view, width = self.view, self.strip.size.width
        row = view.current()
        at = None if row is None else self.strip.strip.place_of(view.store.time(row), width)
        t = None if at is None else self.strip.strip.time_of(max(0, min(at + by, width - 1)), width)
        if t is None:
            self.fail("the capture has no times")
        else:
            self.go_to_time(t)

    def action_frame(self, by: int) -> None:
        """Go to the next frame of the transfer, or the one before."""
        frames = [] if self.shown is None else self.shown.frames
        at = self.bytes.at[0] + by
        if not 0 <= at < len(frames):
            self.fail(
                "this row has no frame" if not frames else f"no frame {'behind' if by > 0 else 'before'} this one"
            )
            return
        if self.tab != TABS[0]:
            self.action_tab(TABS[0])
        self.set_focus(self.bytes)
        self.bytes.to((at, 0))
        one = frames[at]
        self.say(f"frame {one.number} is {at + 1} of {len(frames)} of this transfer, identifier {one.identifier}")

    def go_to(self, place: tuple[int, int] | None, otherwise: str) -> bool:
        """Go to a row by segment and place in it, to the nearest one if a filter hides it; say why not."""
        if place is None:
            self.fail(otherwise)
            return False
        self.following = False
        self.remember()
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
        if not store.first <= frame < store.frames:
            more = "" if self.view.supply.loaded else " so far"
            self.fail(f"there is no frame {frame + 1:,}: frames are {store.first + 1:,} to {store.frames:,}{more}")
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
            self.following = False
            self.remember()
            self.list.to(round(len(self.view.rows) * float(share[1]) / 100))
            return True
        try:
            moment = Moment.parse(text)
        except ValueError as error:
            self.fail(f"{error}, nor a frame")
            return False
        if store.zero is None:
            self.fail("the capture has no times")
            return False
        return self.go_to_time(moment.at(store.zero))

    def begin_at(self) -> None:
        """Go where `--at` says, once that is decoded."""
        text, store = self.start, self.view.store
        if _FRAME.match(text):
            ready = int(text.lstrip("#")) <= store.frames
        else:
            try:
                ready = store.high is not None and store.high >= Moment.parse(text).at(store.zero or 0)
            except ValueError:
                ready = True
        if ready or self.view.supply.loaded:
            self.start = ""
            self.go_where(text)
