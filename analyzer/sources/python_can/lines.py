"""Captures that are text: each line is judged alone, and those that hold a message go through python-can's reader."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Protocol

from can import Message

from analyzer._native import Rows
from analyzer.sources.can_rows import Unreadable
from analyzer.sources.python_can.messages import quoted, words

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from analyzer._native import FrameBatch

# Longer than any frame is in any of these formats.
LONGEST = 1 << 14
_REMARK = 200
_SKIPPED = "python-can skips it"


class Sort(Enum):
    """The kinds of lines, before python-can sees them."""

    MESSAGE = 0
    BLANK = 1
    COMMENT = 2
    OTHER = 3
    ERROR_FRAME = 4
    """One that python-can leaves out."""


class Grammar(Protocol):
    """One text format. Its methods see the lines in order, without their ends."""

    header: tuple[str, ...]
    """The lines that make a new reader of python-can understand the next lines."""

    def sort(self, line: str) -> tuple[Sort, int]:
        """Return what it is, and its time in nanoseconds if it is a message; raises `Unreadable` when it is damaged."""

    def reader(self, file: NumberedText) -> Iterable[Message]:
        """python-can's reader."""

    def store(self, rows: Rows, line: str, message: Message, t: int) -> None:
        """Add the row; raises `Unreadable` when the message is not what the line says."""


def read(
    grammar: Grammar, chunks: Iterator[bytes], is_whole: Callable[[str], bool] | None = None
) -> Iterator[bytes | FrameBatch]:
    """Return a batch of rows for each chunk that ends a line.

    `is_whole` says of a last line without a line end whether nothing is missing, for formats that tell by its content.
    """
    rows, cut = Rows(), _Cutter()
    for chunk in chunks:
        if not chunk:
            yield b""
        elif found := cut.feed(chunk):
            _add(grammar, rows, found)
            yield rows.take()
    if cut.rest:
        if len(cut.rest) > LONGEST or (is_whole is not None and is_whole(_text(cut.rest))):
            _add(grammar, rows, [_text(cut.rest)])
        else:
            rows.cut_short(cut.rest)
        yield rows.take()


class NumberedText:
    """The header and the lines from one on, as a text file; all that python-can's readers ask of one."""

    def __init__(self, header: tuple[str, ...], lines: list[str], at: int) -> None:
        self._header = iter(header)
        self._lines = lines
        self.at = at

    def __iter__(self) -> NumberedText:
        """Itself."""
        return self

    def __next__(self) -> str:
        """Return the next line."""
        for line in self._header:
            return line + "\n"
        if self.at == len(self._lines):
            raise StopIteration
        self.at += 1
        return self._lines[self.at - 1] + "\n"

    def close(self) -> None:
        """There is nothing to close."""


class _Cutter:
    """Cuts chunks into lines; `rest` has no end yet. Of a line that is too long only the start is kept."""

    def __init__(self) -> None:
        self.rest = b""

    def feed(self, chunk: bytes) -> list[str]:
        *lines, rest = chunk.split(b"\n")
        if lines:
            lines[0] = self.rest + lines[0]
            self.rest = b""
        self.rest = (self.rest + rest)[: LONGEST + 1]
        return [_text(line[: LONGEST + 1]) for line in lines]


def _text(line: bytes) -> str:
    # Only ASCII is a digit or a space to python-can then.
    return line.decode("ascii", "replace").strip()


def _add(grammar: Grammar, rows: Rows, lines: list[str]) -> None:
    """Sorts the lines and adds a row for each; messages are read in runs that share a header."""
    run: list[tuple[str, Sort | str, int]] = []
    header = grammar.header
    for line in lines:
        sort: Sort | str
        t = 0
        try:
            if len(line) > LONGEST:
                raise Unreadable(f"line longer than {LONGEST} bytes")  # noqa: TRY301
            sort, t = grammar.sort(line)
        except Unreadable as error:
            sort = str(error)
        if grammar.header != header:
            _add_run(grammar, header, rows, run)
            run, header = [], grammar.header
        run.append((line, sort, t))
    _add_run(grammar, header, rows, run)


def _add_run(grammar: Grammar, header: tuple[str, ...], rows: Rows, run: list[tuple[str, Sort | str, int]]) -> None:
    messages = _messages(grammar, header, [line for line, sort, _ in run if sort is Sort.MESSAGE])
    for line, sort, t in run:
        if sort is Sort.BLANK:
            rows.blank(1)
        elif sort is Sort.COMMENT:
            rows.comment(quoted(line, _REMARK))
        elif sort is Sort.OTHER:
            rows.other(1)
        else:
            try:
                message = _message(sort, messages)
                grammar.store(rows, line, message, t)
            except Unreadable as error:
                rows.unreadable(f"{error}: {quoted(line)}")


def _message(sort: Sort | str, messages: Iterator[Message | str]) -> Message:
    result = next(messages) if sort is Sort.MESSAGE else sort
    if isinstance(result, str):
        raise Unreadable(result)
    return result if isinstance(result, Message) else Message(is_error_frame=True)


def _messages(grammar: Grammar, header: tuple[str, ...], lines: list[str]) -> Iterator[Message | str]:
    """For each line its message, or why there is none. A reader that fails is dead: a new one goes on behind it."""
    done = 0
    while done < len(lines):
        file = NumberedText(header, lines, done)
        reason = _SKIPPED
        try:
            for message in grammar.reader(file):
                yield from [_SKIPPED] * (file.at - done - 1)
                done = file.at
                yield message
        except Exception as error:  # noqa: BLE001 - of any type: python-can checks little
            reason = words(error)
            file.at = max(file.at, done + 1)
        if file.at > done:
            yield from [_SKIPPED] * (file.at - done - 1)
            yield reason
        done = file.at
