"""A filter cut into the marks, words and values that it is made of."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import NamedTuple

from analyzer.filter.language.errors import FilterError

MOST_CHARACTERS = 1 << 16
_MOST_DIGITS = 40
_MOST_PIECES = 64

OPERATORS = {
    "===": "===", "!==": "!==", "==": "==", "!=": "!=", "<=": "<=", ">=": ">=", "&&": "and", "||": "or", "..": "..",
    "<": "<", ">": ">", "~": "matches", "!": "not", "&": "&", "+": "+", "-": "-", "*": "*", "/": "/", "%": "%",
    "(": "(", ")": ")", "{": "{", "}": "}", "[": "[", "]": "]", ",": ",",
}  # fmt: skip
WORDS = {
    "and": "and", "or": "or", "not": "not", "eq": "==", "any_eq": "==", "ne": "!=", "all_ne": "!=", "all_eq": "===",
    "any_ne": "!==", "gt": ">", "lt": "<", "ge": ">=", "le": "<=", "contains": "contains", "matches": "matches",
    "in": "in", "bitwise_and": "&", "mod": "%", "any": "any", "all": "all",
}  # fmt: skip
# What other languages call it.
_MEANT = {
    "=": "==", "=>": ">=", "=<": "<=", "<>": "!=", "|": "||", "^": "", "#": "", ";": "", "?": "", "@": "",
    "\u2265": ">=", "\u2264": "<=", "\u2260": "!=",
}  # fmt: skip
_CAPITALS = ("AND", "OR", "NOT", "IN", "CONTAINS", "MATCHES")
_CURLED = "\u201c\u201d\u201e\u2018\u2019\u00ab\u00bb"

_SPACE = re.compile(r"\s+")
_OCTETS = re.compile(r"[0-9A-Fa-f]{2}(?::[0-9A-Fa-f]{2})+(?![\w:])")
_NUMBER = re.compile(r"0[xX][0-9A-Fa-f]+|0[bB][01]+|(?:\d+(?:\.\d+)?|\.\d+)(?:[eE][+-]?\d+)?")
_DOTTED = re.compile(r"\d+\.\d+(?:\.\d+)+")
_UNIT = re.compile(r"\s*([A-Za-z\u00b0\u00b5\u03bc\u03a9][A-Za-z0-9\u00b0\u00b5\u03bc\u03a9^/]*)(?!\w|\.(?!\.)|\()")
_WORD = re.compile(r"[^\W\d]\w*(?:\.\w+)*")
_TEXT = re.compile(r'(r?)"((?:[^"\\]|\\.)*)"', re.DOTALL)
_CHARACTER = re.compile(r"'((?:[^'\\]|\\.[^']*))'")
_MARK = re.compile("|".join(re.escape(mark) for mark in OPERATORS))
_PIECE = re.compile(r"\s*(-?\d+)?\s*(?:([:-])\s*(-?\d+)?)?\s*([,\]])")


class FilterToken(NamedTuple):
    """A mark, word or value; `kind` is an operator as `OPERATORS` has it, or word, number, octets, text, end."""

    kind: str
    text: str
    start: int
    end: int
    value: int | Fraction | bytes | None = None
    unit: str = ""


class Scanner:
    """Gives the tokens of a filter one after the other; in brackets, where `1:2` is a slice, its pieces."""

    def __init__(self, text: str) -> None:
        self.text, self._at = text, 0
        if len(text) > MOST_CHARACTERS:
            reason = f"a filter has at most {MOST_CHARACTERS} characters, this one has {len(text)}"
            raise FilterError(reason, text, MOST_CHARACTERS, MOST_CHARACTERS + 1)

    def fail(self, reason: str, start: int, end: int) -> FilterError:
        """Return an error about a place."""
        return FilterError(reason, self.text, start, end)

    def next(self) -> FilterToken:
        """Return the next token. Raises `FilterError`."""
        text = self.text
        if space := _SPACE.match(text, self._at):
            self._at = space.end()
        start = self._at
        if start == len(text):
            return FilterToken("end", "", start, start)
        return self._value(start) or self._word(start)

    def _value(self, start: int) -> FilterToken | None:
        text = self.text
        if found := _TEXT.match(text, start):
            return self._took("text", found, found[2], found[1])
        if found := _OCTETS.match(text, start):
            return self._took("octets", found, found[0])._replace(value=bytes.fromhex(found[0].replace(":", "")))
        found = _NUMBER.match(text, start)
        return None if found is None else self._number(found)

    def _word(self, start: int) -> FilterToken:
        text = self.text
        if found := _CHARACTER.match(text, start):
            from analyzer.filter.language.literals import unescaped  # noqa: PLC0415 - few filters have characters

            letter = unescaped(found[1], self.text, start + 1)
            if len(letter) == 1:
                return self._took("number", found, found[0])._replace(value=ord(letter))
            raise self.fail(
                "one character stands between single quotes, text between double quotes", start, found.end()
            )
        if found := _WORD.match(text, start):
            if found[0] in _CAPITALS:
                raise self.fail(f"{found[0]} is written {found[0].lower()}", start, found.end())
            return self._took(WORDS.get(found[0], "word"), found, found[0])
        return self._mark(start)

    def _mark(self, start: int) -> FilterToken:
        text = self.text
        found = _MARK.match(text, start)
        for meant, instead in sorted(_MEANT.items(), key=lambda pair: -len(pair[0])):
            if text.startswith(meant, start) and (found is None or len(meant) > len(found[0])):
                hint = f": write {instead}" if instead else ""
                raise self.fail(f"{meant} is no operator of filters{hint}", start, start + len(meant))
        if found is not None:
            return self._took(OPERATORS[found[0]], found, found[0])
        if text[start] in "\"'" or text.startswith('r"', start):
            raise self.fail("the text that begins here has no quote at its end", start, len(text))
        if text[start] == ":":
            raise self.fail("a colon joins bytes of two hexadecimal digits each, such as 0a:ff", start, start + 1)
        if text[start] in _CURLED:
            raise self.fail('text stands between straight quotes: "text"', start, start + 1)
        raise self.fail(f"{text[start]!r} has no meaning here", start, start + 1)

    def pieces(self) -> list[tuple[int | None, str, int | None, int, int]]:
        """Return what stands between brackets, behind the opening one: start, mark and end of each piece, its place."""
        found, start = [], self._at
        while True:
            piece = _PIECE.match(self.text, self._at)
            if piece is None or not (piece[1] or piece[2]):
                raise self.fail("brackets hold [4], [0:2] (start:length), [0-2], [2:] or [:2]", start, self._at + 1)
            low, high = (
                None if p is None else self._place(p, piece.start(k)) for k, p in ((1, piece[1]), (3, piece[3]))
            )
            found.append((low, piece[2] or "", high, piece.start(), piece.end() - 1))
            self._at = piece.end()
            if len(found) > _MOST_PIECES:
                raise self.fail(f"brackets hold at most {_MOST_PIECES} pieces", start, self._at)
            if piece[4] == "]":
                return found

    def _place(self, digits: str, start: int) -> int:
        if len(digits) > 8:
            raise self.fail("no field is as long", start, start + len(digits))
        return int(digits)

    @property
    def at(self) -> int:
        """The place behind the token that was given last."""
        return self._at

    def _took(self, kind: str, found: re.Match[str], text: str, unit: str = "") -> FilterToken:
        self._at = found.end()
        return FilterToken(kind, text, found.start(), found.end(), unit=unit)

    def _number(self, found: re.Match[str]) -> FilterToken:
        text, start, end = found[0], found.start(), found.end()
        if dotted := _DOTTED.match(self.text, start):
            raise self.fail("this is no number: what has several dots is text, in double quotes", start, dotted.end())
        if len(text) > _MOST_DIGITS:
            raise self.fail("a number has at most 40 digits", start, end)
        value: int | Fraction
        if text[:2].lower() in ("0x", "0b"):
            value = int(text, 0)
        elif text.isdecimal():
            if len(text) > 1 and text[0] == "0" and not set(text) <= set("01234567"):
                raise self.fail("a number that begins with 0 is octal and has no digit above 7", start, end)
            value = int(text, 8 if len(text) > 1 and text[0] == "0" else 10)
        else:
            _, _, exponent = text.lower().partition("e")
            if len(exponent) > 4:
                raise self.fail("the exponent is too large", start, end)
            value = Fraction(text)
        self._at, unit = end, ""
        behind = _UNIT.match(self.text, end)
        if behind is not None and behind[1] not in (*WORDS, *_CAPITALS):
            unit, self._at = behind[1], behind.end()
        if text == "0" and unit[:1] in ("x", "X"):
            raise self.fail("digits of a hexadecimal number are 0 to 9 and a to f", start, self._at)
        return FilterToken("number", text, start, self._at, value=value, unit=unit)
