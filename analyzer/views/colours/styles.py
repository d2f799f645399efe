"""Styles of a terminal by their words: `bold red`, `white on red`, `dim`."""

from __future__ import annotations

from analyzer.filter.language.errors import FilterError, listed, near

COLOURS = ("black", "red", "green", "yellow", "blue", "magenta", "cyan", "white")
EFFECTS = {"bold": "1", "dim": "2", "italic": "3", "underline": "4", "reverse": "7"}
PLAIN = "plain"
_FOREGROUND, _BACKGROUND, _BRIGHT = 30, 40, 60
_WORDS = (*COLOURS, *EFFECTS, "bright", "on", PLAIN)


def codes_of(text: str) -> str:
    """Return the parameters of the escape sequence for a style, empty for `plain`. Raises `FilterError`."""
    words, at = [], 0
    for word in text.split():
        at = text.index(word, at)
        words.append((word.lower(), at))
        at += len(word)
    if not words:
        raise FilterError("a style is missing, such as bold red", text, 0, len(text))
    if [word for word, _ in words] == [PLAIN]:
        return ""
    found: list[str] = []
    behind, bright, used = False, 0, set[str]()
    for word, at in words:
        if word in EFFECTS:
            part, code = word, EFFECTS[word]
        elif word in COLOURS:
            part = "on" if behind else "colour"
            code = str((_BACKGROUND if behind else _FOREGROUND) + bright + COLOURS.index(word))
            behind, bright = False, 0
        elif word in ("on", "bright") and not (behind if word == "on" else bright):
            behind, bright = (True, bright) if word == "on" else (behind, _BRIGHT)
            continue
        else:
            raise _wrong(word, text, at)
        if part in used:
            raise FilterError(f"{word} is one too many", text, at, at + len(word))
        used.add(part)
        found.append(code)
    if behind or bright:
        word, at = words[-1]
        raise FilterError(f"a colour is missing behind {word}", text, at, at + len(word))
    return ";".join(found)


def _wrong(word: str, text: str, at: int) -> FilterError:
    meant = near(word, _WORDS)
    hint = f"did you mean {listed(meant)}?" if meant else f"there are {', '.join(_WORDS)}"
    return FilterError(f"no colour or effect is called {word!r:.40}; {hint}", text, at, at + len(word), meant)
