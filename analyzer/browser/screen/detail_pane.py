"""The details of a row: a tree of lines that fold."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.message import Message

from analyzer.browser.screen.lines import RIGHT, Pane, padded
from analyzer.browser.screen.styles import NAMED, PLAIN
from analyzer.views.terminal import display_width, fit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from textual import events

    from analyzer.browser.details import DetailLine
    from analyzer.browser.screen.lines import Spans

_INDENT = 2
_MANY = 6  # parts in bits of a word that is folded at first
_BEGIN = ("Comment", "Event", "Message")  # what is seen first of a row
_FOLDED = ("can.id",)  # at first


class DetailPane(Pane, can_focus=True):
    """Shows the details of one row; what is folded stays so from row to row."""

    class Selected(Message):
        """Another line is the current one."""

    class Asked(Message):
        """The current line was clicked with the right button."""

    def __init__(self) -> None:
        super().__init__("details")
        self._all: Sequence[DetailLine] = ()
        self._folded: set[str] = set(_FOLDED)
        self._words: set[str] = set()  # of many bits, and arrays: folded when they are seen first
        self._at = self._top = 0

    def take(self, lines: Sequence[DetailLine]) -> None:
        """Show another row, at the line of the same name if there is one."""
        old = self.line
        self._all = lines
        for k, line in enumerate(lines):
            if (key := _key(line)) not in self._words and (len(self._parts(k)) >= _MANY or self._is_array(k)):
                self._words.add(key)
                self._folded.add(key)
        seen = self._seen()
        usual = old is None or not old.depth or old.text.startswith(_BEGIN)
        here = ("", 0) if old is None or usual else (old.name, old.depth)
        same = [k for k, line in enumerate(seen) if line.name and (line.name, line.depth) == here]
        begin = next((k for k, line in enumerate(seen) if line.text.startswith(_BEGIN)), 0)
        self._at = same[0] if same else begin
        self._top = begin if not same else self._top
        self.draw()

    @property
    def line(self) -> DetailLine | None:
        """The current line."""
        seen = self._seen()
        return seen[min(self._at, len(seen) - 1)] if seen else None

    def select(self, index: int) -> None:
        """Go to a line, by its place in all of them; what it is folded into opens."""
        if not 0 <= index < len(self._all):
            return
        wanted = self._all[index]
        depth = wanted.depth
        for above in reversed(self._all[:index]):
            if above.depth < depth:
                self._folded.discard(_key(above))
                depth = above.depth
        self._at = next((k for k, line in enumerate(self._seen()) if line is wanted), self._at)
        self.draw()
        self.post_message(self.Selected())

    def move(self, by: int) -> None:
        """Go so many lines further."""
        self._at = max(0, min(self._at + by, len(self._seen()) - 1))
        self.draw()
        self.post_message(self.Selected())

    def fold(self, *, shut: bool | None = None) -> None:
        """Fold what is below the current line, or open it."""
        line = self.line
        if line is None:
            return
        key = _key(line)
        shut = key not in self._folded if shut is None else shut
        if shut and not self._below(line):  # the one that it is below
            index = next(k for k, one in enumerate(self._all) if one is line)
            above = next((k for k in range(index - 1, -1, -1) if self._all[k].depth < line.depth), None)
            if above is not None:
                self.select(above)
            return
        (self._folded.add if shut else self._folded.discard)(key)
        self.draw()

    @property
    def cut(self) -> bool:
        """True if the current line does not fit, and nothing is below it that could be folded."""
        line = self.line
        if line is None or self._below(line):
            return False
        return display_width(line.text) + line.depth * _INDENT + 2 > self.size.width

    @property
    def folded(self) -> bool:
        """True if all that can be folded is."""
        return all(_key(line) in self._folded for line in self._all if line.depth and self._below(line))

    def fold_all(self, *, shut: bool) -> None:
        """Fold everything, or open it."""
        self._folded = {_key(line) for line in self._all if self._below(line) and line.depth} if shut else set()
        self._at = 0
        self.draw()

    def draw(self) -> None:
        """Draw the lines that are seen."""
        width, height = self.size
        if not width or height < 1:
            return
        seen = self._seen()
        room = max(1, height - 1)
        self._at = max(0, min(self._at, len(seen) - 1))
        self._top = max(0, min(self._top, self._at, max(0, len(seen) - room)))
        if self._at >= self._top + room:
            self._top = self._at - room + 1
        style = NAMED["title" if self.has_focus else "head"]
        more = "" if len(seen) <= room else f"  {self._top + 1}-{min(self._top + room, len(seen))}/{len(seen)}"
        shown: list[Spans] = [((padded(fit(f" Details{more}", width), width), style),)]
        for k, line in enumerate(seen[self._top : self._top + room], self._top):
            below = self._below(line)
            sign = " " if not below else "+" if _key(line) in self._folded else "-"
            told = self._told(line) if sign == "+" else line.text
            text = fit(f"{' ' * (line.depth * _INDENT)}{sign} {told}", width)
            style = NAMED["focus"] if k == self._at else NAMED["bold"] if below and line.depth < _INDENT else PLAIN
            shown.append(((padded(text, width), style),))
        self.put(shown)

    def _parts(self, index: int) -> list[DetailLine]:
        """Return the parts in bits of a word."""
        word, found = self._all[index], []
        for line in self._all[index + 1 :] if word.bits is not None else ():
            if line.depth <= word.depth:
                break
            if line.inside and line.bits == word.bits:
                found.append(line)
        return found

    def _is_array(self, index: int) -> bool:
        """Return whether elements of a line are below it."""
        name, below = self._all[index].name, self._all[index + 1 : index + 2]
        return bool(name and below and below[0].name.startswith(f"{name}["))

    def _told(self, line: DetailLine) -> str:
        """Return a folded line: of a word with parts in bits what is set in it, in place of where it lies."""
        parts = self._parts(next(k for k, one in enumerate(self._all) if one is line))
        if not parts:
            return line.text
        some = [part for part in parts if not part.value.startswith("not set")]
        words = (f"{part.name.rpartition('.')[2]} {part.value.removesuffix(': set')}" for part in some)
        return f"{line.text.partition('  ')[0]}  {', '.join(words) or 'nothing is set'}"

    def _below(self, line: DetailLine) -> bool:
        index = next((k for k, one in enumerate(self._all) if one is line), len(self._all))
        return index + 1 < len(self._all) and self._all[index + 1].depth > line.depth

    def _seen(self) -> list[DetailLine]:
        seen: list[DetailLine] = []
        hidden: int | None = None
        for line in self._all:
            if hidden is not None and line.depth > hidden:
                continue
            hidden = line.depth if _key(line) in self._folded else None
            seen.append(line)
        return seen

    def on_mouse_down(self, event: events.MouseDown) -> None:
        """Go to a line; once more folds it."""
        place = self._top + event.y - 1
        if 0 <= place < len(self._seen()) and event.y >= 1:
            if event.button == RIGHT:
                self.move(place - self._at)
                self.post_message(self.Asked())
            elif place == self._at:
                self.fold()
            else:
                self.move(place - self._at)

    def on_mouse_scroll_down(self, _: events.MouseScrollDown) -> None:
        """Go on."""
        self.move(3)

    def on_mouse_scroll_up(self, _: events.MouseScrollUp) -> None:
        """Go back."""
        self.move(-3)


def _key(line: DetailLine) -> str:
    """Return what tells a line from others, in rows of all kinds."""
    return line.name or line.text.split(" ")[0].rstrip(":,")
