"""Text that is safe to print: escapes for what came from a capture, cuts by display width, and colours."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass

_COMMENT_AT = 11  # column
ELLIPSIS = "…"

_STYLES = {
    "head": "1",
    "good": "32",
    "code": "36",
    "bad": "31",
    "note": "33",
    "dim": "2",
    "crc": "35",
    "payload": "36",
    "padding": "2",
    "tail": "33",
}


def escape(text: str | bytes) -> str:
    r"""Return `text` with everything that could fool a terminal or a reader written as `\xNN` or `\uNNNN`.

    That is every character that is not printable: control characters, escape sequences, changes of writing direction,
    invisible and unassigned characters, all blanks but the plain one, and bytes that are not UTF-8.
    """
    if isinstance(text, bytes):
        text = text.decode("utf-8", "surrogateescape")
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else _escaped(ord(c)) for c in text)


def _escaped(code: int) -> str:
    if 0xDC80 <= code <= 0xDCFF:  # a byte that was not UTF-8
        code -= 0xDC00
    if code < 0x100:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def comment_line(text: str) -> str:
    """Return the line of a list that says what somebody wrote about the row above it."""
    return f"{' ' * _COMMENT_AT}# {escape(text)}"


def display_width(text: str) -> int:
    """Count terminal columns that printable text takes: wide characters count two, combining ones none."""
    if text.isascii():
        return len(text)
    return sum(_columns(c) for c in text)


def fit(text: str, width: int) -> str:
    """Return `text` in at most `width` columns, an ellipsis where it was cut."""
    if display_width(text) <= width:
        return text
    if width <= 0:
        return ""
    used, kept = 0, []
    for c in text:
        used += _columns(c)
        if used > width - 1:
            break
        kept.append(c)
    return "".join(kept) + ELLIPSIS


def fit_name(name: str, width: int) -> str:
    """Return a name in at most `width` columns; what is cut is in its middle, since names differ at their ends."""
    if display_width(name) <= width:
        return name
    room, kept = width * 2 // 3, len(name)
    while kept and display_width(name[kept - 1 :]) <= room:
        kept -= 1
    return fit(name, width - display_width(name[kept:])) + name[kept:]


def _columns(c: str) -> int:
    if unicodedata.category(c) in ("Mn", "Me"):
        return 0
    return 2 if unicodedata.east_asian_width(c) in "WF" else 1


@dataclass(frozen=True, slots=True)
class Palette:
    """Colours, if `on`. The caller decides: only on a terminal, and not with NO_COLOR."""

    on: bool = False

    def around(self, style: str) -> tuple[str, str]:
        """Return what stands before a text in a style, and what behind it."""
        return (f"\x1b[{_STYLES[style]}m", "\x1b[0m") if self.on else ("", "")

    def colour(self, codes: str, text: str) -> str:
        """Paint `text` with the parameters of an escape sequence, if there are some."""
        return f"\x1b[{codes}m{text}\x1b[0m" if self.on and codes and text else text

    def paint(self, style: str, text: str) -> str:
        """Paint `text` in one of the styles head, good, code, bad, note, dim, crc, payload, padding, tail."""
        return text.join(self.around(style)) if text else text


PLAIN = Palette()
