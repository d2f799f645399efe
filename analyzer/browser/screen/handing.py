"""What is kept, and what is handed on: marks, comments, files, the clipboard, the picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from analyzer.browser.conditions import condition
from analyzer.browser.store.order import TRANSFER
from analyzer.views.records import JsonLines

if TYPE_CHECKING:
    from collections.abc import Sequence

    from textual import events

    from analyzer.browser.screen.app import Browser

_COPIES = {"t": "text", "j": "JSON", "c": "candump", "f": "filter", "d": "details"}


class Tools(Protocol):
    """Other commands, and what is kept for the user; `said` are lines about what has ended meanwhile."""

    said: list[str]

    def write(self, path: str, filter_text: str) -> str:
        """Write what a filter selects to a file; return what was done. Raises `ValueError` with the reason why not."""

    def plot(self, frame: int) -> str:
        """Open the picture around a frame, from 0; return what was done. Raises `ValueError`."""

    def keep_columns(self, names: Sequence[str]) -> None:
        """Keep columns for the next time."""


class Handing:
    """The part of the browser that keeps and hands on."""

    chord = ""
    _warned = False

    def frames_now(self: Browser) -> list[int]:
        """Return the frames of the current row, from 0."""
        row = self.view.current()
        return [] if row is None else self.view.places_of(row)

    def action_mark(self: Browser) -> None:
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

    def comment(self: Browser, text: str) -> None:
        """Write a comment on this row."""
        places = self.frames_now()
        if not places:
            self.fail("only rows of frames have comments")
            return
        marks = self.view.marks
        frame = next((place for place in places if place in marks.marks), places[0])
        marks.comment(frame, text, self.view.store.frame_time(frame))
        self._kept("kept" if text else "the comment is gone")

    def _kept(self: Browser, said: str) -> None:
        marks = self.view.marks
        try:
            marks.save()
        except OSError as error:
            self.fail(f"{marks.path}: {error.strerror}: marks are not kept")
        else:
            self.say(said if marks.path is None else f"{said}: {marks.path}")
        self.list.draw()
        self.strip.draw()

    # ---- hand on

    def write(self: Browser, path: str) -> None:
        """Write what is displayed to a file."""
        try:
            self.say(self.tools.write(path, self.view.filter))
        except ValueError as error:
            self.fail(str(error))

    def action_plot(self: Browser) -> None:
        """Open the picture at this time."""
        places = self.frames_now()
        row = self.view.current()
        if row is None:
            return
        try:
            self.say(self.tools.plot(places[0] if places else row.place))
        except ValueError as error:
            self.fail(str(error))

    def action_copy(self: Browser) -> None:
        """Ask what to copy."""
        self.chord = "copy"
        self.say("copy: t text  j JSON  c candump lines  f filter of the field  d details", "bold")

    def copy(self: Browser, key: str) -> None:
        """Copy the current row in one of several forms."""
        form = _COPIES.get(key)
        text = "" if form is None else self.copied(form)
        if not text:
            self.fail("nothing is copied" if form is None else f"this row has no {form}")
            return
        self.copy_to_clipboard(text)
        first = text.splitlines()[0]
        self.say(f"copied: {first}" + (" ..." if "\n" in text.rstrip() else ""))

    def copied(self: Browser, form: str) -> str:
        """Return the current row as text, JSON, candump lines, a filter or its details."""
        view, shown, row = self.view, self.shown, self.view.current()
        if row is None or shown is None:
            return ""
        if form == "text":
            return view.pages.lines([row], 500)[0].text.rstrip()
        if form == "details":
            return "\n".join(f"{'    ' * line.depth}{line.text}" for line in shown.lines)
        if form == "filter":
            line = self.details.line
            return "" if line is None else condition(line, view.supply.registry, shown.batch)
        if form == "JSON":
            if row.kind != TRANSFER or shown.batch is None:
                return ""
            return "".join(JsonLines(view.supply.registry).rows(shown.batch)).rstrip("\n")
        lines = []
        for place in view.places_of(row):
            frame = view.frames(place)
            if frame is not None:
                second, ns = divmod(frame.t or 0, 10**9)
                lines.append(f"({second}.{ns // 1000:06d}) {view.store.buses[frame.bus]} {frame.candump}")
        return "\n".join(lines)

    # ---- keys that follow another one, and the end

    def on_event_key(self: Browser, key: str) -> bool:
        """Take the second key of a chord; return whether it was one."""
        chord, self.chord = self.chord, ""
        if not chord:
            return False
        (self.copy if chord == "copy" else self.follow)(key)
        return True

    async def on_event(self: Browser, event: events.Event) -> None:
        """Take the second key of a chord before anybody else does."""
        from textual.events import Key  # noqa: PLC0415 - types only above

        if isinstance(event, Key) and self.chord and self.on_event_key(event.key):
            event.prevent_default()
            event.stop()
            return
        await super().on_event(event)  # type: ignore[misc]  # of Textual's App

    def action_leave(self: Browser) -> None:
        """Quit; a mark that could not be kept is worth a warning."""
        marks = self.view.marks
        if marks.changed and marks.marks and not self._warned:
            self._warned = True
            self.fail("marks are not kept: q once more leaves without them")
            return
        self.view.supply.stop()
        self.exit()
