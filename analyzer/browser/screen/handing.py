"""What is kept, and what is handed on: marks, comments, files, the clipboard, the picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.browser.conditions import condition
from analyzer.browser.screen.moving import Moving
from analyzer.views.records import JsonLines

if TYPE_CHECKING:
    from analyzer.browser.store.store import Row

_COPIES = {"t": "text", "j": "JSON", "c": "candump", "f": "filter", "d": "details"}


class Handing(Moving):
    """The part of the browser that keeps and hands on."""

    _warned = False

    def frames_now(self) -> list[int]:
        """Return the frames of the current row, from 0."""
        row = self.view.current()
        return [] if row is None else self.view.places_of(row)

    def action_mark(self) -> None:
        """Mark this row, or take the mark off."""
        places, marks = self.frames_now(), self.view.marks
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
        self.strip.draw()

    # ---- hand on

    def write(self, path: str) -> None:
        """Write what is displayed to a file."""
        try:
            self.say(self.tools.write(path, self.view.filter))
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
        self.chord = "copy"
        self.say("copy: t text  j JSON  c candump lines  f filter of the field  d details", "bold")

    def copy(self, key: str) -> None:
        """Copy the current row in one of several forms."""
        form = _COPIES.get(key)
        text = "" if form is None else self.copied(form)
        if not text:
            self.fail("nothing is copied" if form is None else f"this row has no {form}")
            return
        self.copy_to_clipboard(text)
        first = text.splitlines()[0]
        self.say(f"copied: {first}" + (" ..." if "\n" in text.rstrip() else ""))

    def copied(self, form: str) -> str:
        """Return the current row as text, JSON, candump lines, a filter or its details."""
        view, shown, row = self.view, self.shown, self.view.current()
        if row is None or shown is None:
            return ""
        if form == "text":
            return view.pages.lines([row], 500)[0].text.rstrip()
        if form == "details":
            return "\n".join(f"{'    ' * line.depth}{line.text}" for line in shown.lines)
        if form == "candump":
            return self._candump(row)
        line = self.details.line
        if form == "filter":
            return "" if line is None else condition(line, view.supply.registry, shown.batch)
        return "" if shown.batch is None else "".join(JsonLines(view.supply.registry).rows(shown.batch)).rstrip("\n")

    def _candump(self, row: Row) -> str:
        """Return the frames of a row as `candump -l` writes them."""
        view = self.view
        lines = []
        for place in view.places_of(row):
            frame = view.frames(place)
            if frame is not None:
                second, ns = divmod(frame.t or 0, 10**9)
                lines.append(f"({second}.{ns // 1000:06d}) {view.store.buses[frame.bus]} {frame.candump}")
        return "\n".join(lines)

    def action_leave(self) -> None:
        """Quit; a mark that could not be kept is worth a warning."""
        marks = self.view.marks
        if marks.changed and marks.marks and not self._warned:
            self._warned = True
            self.fail("marks are not kept: q once more leaves without them")
            return
        self.view.supply.stop()
        self.exit()
