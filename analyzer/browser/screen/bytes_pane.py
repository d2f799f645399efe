"""The bytes of a row; what the details speak of is lit, and a byte that one is at selects its field."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.message import Message

from analyzer.browser.dump import Lit, binary
from analyzer.browser.screen.lines import Pane
from analyzer.browser.screen.styles import NAMED, PLAIN
from analyzer.views.terminal import fit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.style import Style
    from textual import events

    from analyzer.browser.dump import DumpByte, DumpFrame
    from analyzer.browser.screen.lines import Spans

_PER_LINE, _CLASSIC = 16, 8
_CELL = 3  # columns of a byte
_NUMBER, _IDENTIFIER, _GAP = 10, 8, 2  # columns before the bytes of a frame


class BytesPane(Pane, can_focus=True):
    """Shows frames in hexadecimal, 16 bytes a line, 8 where it is narrow, and in bits what is lit."""

    class Selected(Message):
        """Another byte is the current one."""

    def __init__(self) -> None:
        super().__init__("bytes")
        self._frames: Sequence[DumpFrame] = ()
        self._lit = Lit()
        self._lines: list[tuple[int, int]] = []  # frame and first byte of each line
        self._per_line = _PER_LINE
        self.at = (0, 0)
        self._top = 0

    def take(self, frames: Sequence[DumpFrame]) -> None:
        """Show another row."""
        self._frames = frames
        self._break()
        self.at, self._top = (0, 0), 0

    def _break(self) -> None:
        """Break frames into lines, all of whose bytes can be seen."""
        longest = max((_left(one) for one in self._frames), default=0)
        self._per_line = _PER_LINE if longest + _CELL * _PER_LINE <= self.size.width else _CLASSIC
        self._lines = [
            (k, start)
            for k, frame in enumerate(self._frames)
            for start in range(0, max(1, len(frame.data)), self._per_line)
        ]

    def on_resize(self) -> None:
        """Break lines for the room that there is now."""
        self._break()
        self._top = self._place(self.at)
        super().on_resize()

    def light(self, lit: Lit) -> None:
        """Light bytes, and go to where they are, but not away from a byte that one is at."""
        self._lit = lit
        if lit.bytes and not self.has_focus:
            self.at = min(lit.bytes)
            place, room = self._place(self.at), self._room()
            if not self._top <= place < self._top + room:
                self._top = max(0, place - room // 2)
        self.draw()

    def move(self, by: int) -> None:
        """Go so many bytes further; frames follow each other."""
        every = [(k, n) for k, frame in enumerate(self._frames) for n in range(len(frame.data))]
        if every:
            now = every.index(self.at) if self.at in every else 0
            self.to(every[max(0, min(now + by, len(every) - 1))])

    def step(self, by: int) -> None:
        """Go to the same place of a line further down, or up: the next frame of the transfer."""
        if not self._lines:
            return
        place = max(0, min(self._place(self.at) + by, len(self._lines) - 1))
        frame, start = self._lines[place]
        within = self.at[1] % self._per_line
        self.to((frame, max(0, min(start + within, len(self._frames[frame].data) - 1))))

    def to(self, at: tuple[int, int]) -> None:
        """Go to a byte."""
        self.at = at
        place, room = self._place(at), self._room()
        self._top = min(max(self._top, place - room + 1), place)
        self.draw()
        self.post_message(self.Selected())

    def draw(self) -> None:
        """Draw the frames that are seen, and below them the bits."""
        width, height = self.size
        if not width or height < 1:
            return
        room = self._room()
        self._top = max(0, min(self._top, len(self._lines) - room))
        style = NAMED["title" if self.has_focus else "head"]
        count = len(self._frames)
        frames = f"{count} frame{'s' * (count != 1)}" if count else "no frame"
        shown: list[Spans] = [self._title(f" Bytes  {frames}", width, style)]
        shown += [self._line(*one, width) for one in self._lines[self._top : self._top + room]]
        self.put(shown)

    def _title(self, text: str, width: int, style: Style) -> Spans:
        """Return the first line, with the bits of what is lit."""
        spans: list[tuple[str, Style]] = [(text, style)]
        used = len(text)
        for digits, lit in binary(self._frames, self._lit):
            if used + 10 > width:
                break
            spans.append(("  ", style))
            spans += [(one, NAMED["lit"] if k in lit else NAMED["dim"]) for k, one in enumerate(digits)]
            used += 10
        return (*spans, (" " * max(0, width - used), style))

    def _line(self, frame: int, start: int, width: int) -> Spans:
        one = self._frames[frame]
        head = f"{one.number:>{_NUMBER - 1}} " if start == 0 else " " * _NUMBER
        spans: list[tuple[str, Style]] = [(head, NAMED["dim"])]
        if start == 0:
            digits = self._lit.digits if one.extended else frozenset()
            letters = one.identifier.ljust(_IDENTIFIER)
            spans += [(c, NAMED["lit"] if k in digits else PLAIN) for k, c in enumerate(letters)]
        else:
            spans.append((" " * max(_IDENTIFIER, len(one.identifier)), PLAIN))
        spans.append((" " * _GAP, PLAIN))
        data = one.data[start : start + self._per_line]
        before = one.data[start - 1].role if start else None
        for k, byte in enumerate(data, start):
            gap = "|" if before is not None and byte.role != before else " "
            spans += [(gap, NAMED["dim"]), (f"{byte.value:02X}", self._style(frame, k, byte))]
            before = byte.role
        full = _CLASSIC if all(len(some.data) <= _CLASSIC for some in self._frames) else self._per_line
        spans.append((" " * (_CELL * (full - len(data)) + 2), PLAIN))
        for k, byte in enumerate(data, start):
            letter = chr(byte.value) if 32 <= byte.value < 127 else "."
            spans.append((letter, self._style(frame, k, byte)))
        return _cut(spans, width)

    def _style(self, frame: int, k: int, byte: DumpByte) -> Style:
        style = NAMED["lit"] if (frame, k) in self._lit.bytes else NAMED[byte.role]
        return style + NAMED["cursor"] if self.has_focus and self.at == (frame, k) else style

    def _place(self, at: tuple[int, int]) -> int:
        lines = [k for k, (frame, start) in enumerate(self._lines) if (frame, start) <= at]
        return lines[-1] if lines else 0

    def _room(self) -> int:
        return max(1, self.size.height - 1)

    def on_mouse_down(self, event: events.MouseDown) -> None:
        """Go to a byte."""
        place = self._top + event.y - 1
        if event.y < 1 or place >= len(self._lines):
            return
        frame, start = self._lines[place]
        k = start + max(0, (event.x - _left(self._frames[frame]) - 1) // _CELL)
        if k < len(self._frames[frame].data) and k < start + self._per_line:
            self.to((frame, k))


def _left(frame: DumpFrame) -> int:
    """Return how many columns stand before the bytes of a frame: its number and its identifier."""
    return _NUMBER + max(_IDENTIFIER, len(frame.identifier)) + _GAP


def _cut(spans: Sequence[tuple[str, Style]], width: int) -> Spans:
    """Return spans that fit."""
    found, used = [], 0
    for text, style in spans:
        if used >= width:
            break
        part = fit(text, width - used)
        found.append((part, style))
        used += len(part)
    return tuple(found)
