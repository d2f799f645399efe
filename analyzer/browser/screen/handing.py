"""Keep marks, and hand on rows: marks, comments, files, the clipboard, the picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.browser.conditions import condition
from analyzer.browser.screen.searching import Searching
from analyzer.browser.store.cut import cut_transfers
from analyzer.browser.store.order import TRANSFER
from analyzer.browser.view import MOST_NAMED
from analyzer.views.records import JsonLines

if TYPE_CHECKING:
    from analyzer.browser.store.store import ListRow

_MOST_COPIED = 2000  # rows: a clipboard goes through the terminal
_COPIES = {
    "t": "text", "j": "JSON", "c": "candump", "f": "filter", "d": "details", "v": "value", "b": "bytes", "l": "line",
}  # fmt: skip


class Handing(Searching):
    """The part of the browser that keeps and hands on."""

    _warned = False
    reload = False  # what is shown is to be read anew

    def frames_now(self) -> list[int]:
        """Return the frames of the current row, from 0."""
        row = self.view.current()
        return [] if row is None else self.view.places_of(row)

    def action_mark(self) -> None:
        """Mark this row, or all that are selected; or take the mark of this one off."""
        places, marks = self.frames_now(), self.view.marks
        if self.view.begun is not None:
            self._mark_selected()
            return
        if not places:
            self.fail("only rows of frames are marked")
            return
        own = [place for place in places if place in marks.marks]
        frame = own[0] if own else places[0]
        if own and marks.marks[frame].text:
            self.fail("this row has a comment: M and an empty line take it off")
            return
        now = marks.toggle(frame, self.view.store.frame_time(frame))
        self._kept("marked" if now else "not marked any more")

    def _mark_selected(self) -> None:
        view = self.view
        chosen = view.selected()
        if len(chosen) > MOST_NAMED:
            self.fail(f"{MOST_NAMED:,} rows are marked at a time at most")
            return
        rows = [places for number in chosen if (places := view.places_of(view.row(number)))]
        fresh = [min(places) for places in rows if not any(place in view.marks.marks for place in places)]
        for frame in fresh:
            view.marks.toggle(frame, view.store.frame_time(frame))
        self._kept(f"{len(fresh):,} rows marked")

    def comment(self, text: str) -> None:
        """Write a comment on this row."""
        places = self.frames_now()
        if not places:
            self.fail("only rows of frames have comments")
            return
        marks = self.view.marks
        frame = next((place for place in places if place in marks.marks), places[0])
        marks.comment(frame, text, self.view.store.frame_time(frame))
        self._kept("kept" if text else "the comment is gone")

    def _kept(self, said: str) -> None:
        marks = self.view.marks
        try:
            marks.save()
        except OSError as error:
            self.fail(f"{marks.path}: {error.strerror}: marks are not kept")
        else:
            self.say(said if marks.path is None else f"{said}: {marks.path.name}")
        self.list.draw()
        self.show_row()
        self.strip.draw()

    # ---- hand on

    def write(self, path: str) -> None:
        """Write what is displayed to a file."""
        view = self.view
        try:
            chosen = view.filter_of_all() if view.begun is None else view.filter_of(view.selected())
            if view.begun is not None and not chosen:
                self.fail("the selected rows have no frames")
            else:
                self.say(self.tools.write(path, chosen))
        except ValueError as error:
            self.fail(str(error))

    def action_plot(self) -> None:
        """Open the picture at this time."""
        places = self.frames_now()
        row = self.view.current()
        if row is None:
            return
        try:
            self.say(self.tools.plot(places[0] if places else row.place))
        except ValueError as error:
            self.fail(str(error))

    def action_copy(self) -> None:
        """Ask what to copy."""
        self.chord, count = "copy", len(self.view.selected())
        what = f"{count:,} rows" if self.view.begun is not None else "this row"
        self.say(f"copy {what}: t text  j JSON  c candump  d details  b bytes  v value  f as filter", "bold")

    def copy(self, key: str) -> None:
        """Copy the selected rows, or the current one, in one of several forms."""
        form = _COPIES.get(key)
        try:
            text = "" if form is None else self.copied(form)
        except ValueError as error:
            self.fail(str(error))
            return
        if not text:
            self.fail("nothing is copied" if form is None else f"this row has no {form}")
            return
        self.copy_to_clipboard(text)
        lines = text.rstrip().splitlines()
        more = f" ... {len(lines):,} lines" if len(lines) > 1 else ""
        left = len(self.view.selected()) - _MOST_COPIED
        self.say(f"copied: {lines[0]}{more}" + (f", {left:,} rows left out: w writes all" if left > 0 else ""))

    def copied(self, form: str) -> str:
        """Return rows as text, JSON, candump lines or details; a field of one row, or the rows, as a filter."""
        if form == "line":
            return "" if self.tabs.line is None else self.tabs.line.text
        view, shown, numbers = self.view, self.shown, self.view.selected()[:_MOST_COPIED]
        if not numbers or shown is None:
            return ""
        line = self.details.line
        if form == "value":
            return "" if line is None else line.value or line.text
        if form == "filter" and view.begun is None and line is not None:
            return condition(line, view.supply.registry, shown.batch)
        if form == "filter":
            return view.filter_of(numbers)
        rows = [view.row(number) for number in numbers]
        forms = {
            "text": self._lines, "JSON": self._json, "details": self._details, "candump": self._frames,
            "bytes": self._bytes,
        }  # fmt: skip
        return forms[form](rows)

    def _bytes(self, rows: list[ListRow]) -> str:
        """Return what transfers carry, and frames that form none, in hexadecimal, a row a line."""
        return "\n".join(filter(None, (self.view.content(row).hex() for row in rows)))

    def _lines(self, rows: list[ListRow]) -> str:
        rules = map(self.view.rules_of, rows)
        lines = zip(self.view.pages.lines(rows, 500), rules, strict=True)
        return "\n".join("  ".join((line.text.rstrip(), *some)) for line, some in lines)

    def _json(self, rows: list[ListRow]) -> str:
        view = self.view
        at = sorted(view.number_of(row) for row in rows if row.kind == TRANSFER)
        texts = JsonLines(view.supply.registry).rows(cut_transfers(view.store, at)) if at else ()
        return "".join(texts).rstrip("\n")

    def _details(self, rows: list[ListRow]) -> str:
        every = (self.view.shown(row, elements=False).lines for row in rows)
        return "\n\n".join("\n".join(f"{'    ' * line.depth}{line.text}" for line in lines) for lines in every)

    def _frames(self, rows: list[ListRow]) -> str:
        return "\n".join(filter(None, map(self._candump, rows)))

    def _candump(self, row: ListRow) -> str:
        """Return the frames of a row as `candump -l` writes them."""
        view = self.view
        lines = []
        for place in view.places_of(row):
            frame = view.frames(place)
            if frame is not None:
                second, ns = divmod(frame.t or 0, 10**9)
                lines.append(f"({second}.{ns // 1000:06d}) {view.store.buses[frame.bus]} {frame.candump}")
        return "\n".join(lines)

    def action_reload(self) -> None:
        """Read the captures anew, and come back to this row."""
        if wrong := self.view.supply.only_once():
            self.fail(wrong)
            return
        self.reload = True
        self.view.supply.stop()
        self.exit()

    def action_leave(self) -> None:
        """Quit; a mark that could not be kept is worth a warning."""
        marks = self.view.marks
        if marks.changed and marks.marks and not self._warned:
            self._warned = True
            self.fail("marks are not kept: q once more leaves without them")
            return
        self.view.supply.stop()
        self.exit()
