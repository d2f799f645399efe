"""Styles of the browser: only the 16 colours of every terminal; without them signs and reversed text say the same."""

from __future__ import annotations

from functools import lru_cache

from rich.style import Style

from analyzer.views.colours.styles import COLOURS

PLAIN = Style()
NAMED = {
    "": PLAIN,
    "bold": Style(bold=True),
    "dim": Style(dim=True),
    "good": Style(color="green"),
    "warn": Style(color="yellow"),
    "bad": Style(color="red", bold=True),
    "head": Style(color="cyan", bold=True),
    "focus": Style(reverse=True),
    "selected": Style(underline=True),
    "title": Style(color="cyan", bold=True, reverse=True),
    "crc": Style(color="magenta"),
    "tail": Style(color="yellow"),
    "payload": PLAIN,
    "lit": Style(reverse=True, bold=True),
    "cursor": Style(underline=True, bold=True),
}
# Of conversations that are told apart; a digit in front of the row says the same.
CONVERSATIONS = tuple(Style(color=name, bold=True) for name in ("cyan", "magenta", "blue", "yellow", "green", "white"))
_BASES = ((30, "color", ""), (90, "color", "bright_"), (40, "bgcolor", ""), (100, "bgcolor", "bright_"))
_EFFECTS = {1: "bold", 2: "dim", 3: "italic", 4: "underline", 7: "reverse"}


@lru_cache(maxsize=256)
def of_codes(codes: str) -> Style:
    """Return the style of the parameters of an escape sequence, as colour rules have them."""
    found: dict[str, object] = {}
    for word in filter(str.isdigit, codes.split(";")):
        code = int(word)
        if code in _EFFECTS:
            found[_EFFECTS[code]] = True
        for base, key, bright in _BASES:
            if base <= code < base + len(COLOURS):
                found[key] = bright + COLOURS[code - base]
    return Style(**found)  # type: ignore[arg-type]
