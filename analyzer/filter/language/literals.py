"""Values as they are written in filters: text with escapes, times, patterns, units behind numbers."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from analyzer.filter.language.errors import FilterError
from analyzer.filter.values import ByteSpans, CodedWords
from analyzer.window.limits import Moment

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.filter.language.syntax import QuotedText
    from dissectors.kit import Array

_PREFIXES = {"": 0, "n": -9, "u": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}
_SCALED = ("V", "A", "W", "Wh", "Ah", "Hz", "s", "m", "g", "N", "Pa", "T", "J", "F")  # units that take a prefix
_OTHER = {"min": ("s", Fraction(60)), "h": ("s", Fraction(3600))}
_SPELLED = {
    "\u00b0": "deg", "\u00b0C": "degC", "C": "degC", "\u00b0K": "K", "RPM": "rpm", "percent": "%", "sec": "s",
    "volt": "V", "amp": "A", "hz": "Hz", "khz": "kHz", "v": "V", "mv": "mV", "ma": "mA", "degc": "degC", "kelvin": "K",
}  # fmt: skip
MOST_PATTERN = 1000
# What RE2 says of expressions that others know.
_UNKNOWN = {
    "invalid perl operator": "look-ahead and look-behind are not known here",
    "invalid escape sequence": "an escape in it means nothing here; a backslash is written \\\\",
    "missing )": "a closing parenthesis is missing",
    "unexpected )": "an opening parenthesis is missing",
    "missing ]": "a closing bracket is missing",
    "no argument for repetition operator": "there is nothing before *, + or ? that could be repeated",
}
_ESCAPE = re.compile(r"\\(?:x([0-9A-Fa-f]{1,2})|u([0-9A-Fa-f]{4})|U([0-9A-Fa-f]{8})|([0-7]{1,3})|(.))", re.DOTALL)
_ASCII_END, _BYTE_END = 0x80, 0x100
BYTE = 0xDC00  # what a byte that stands for itself is behind, until it is bytes or text
_SINGLE = {"a": "\a", "b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t", "v": "\v"}


def unescaped(written: str, text: str, start: int, *, pattern: bool = False) -> str:
    r"""Return what a text with escapes stands for; `start` is its place in the filter `text`.

    `\xNN` and octal escapes behind ASCII are bytes, which stand in it as surrogates do. In a `pattern` they are
    characters, and unknown escapes stay, for they mean something there. Raises `FilterError`.
    """

    def one(found: re.Match[str]) -> str:
        short, wide, wider, octal, other = found.groups()
        if other is None:
            code = int(octal, 8) if octal else int(short or wide or wider, 16)
            if not pattern and (octal or short) and _ASCII_END <= code < _BYTE_END:
                return chr(BYTE + code)
            if code <= 0x10FFFF and not 0xD800 <= code < 0xE000:
                return re.escape(chr(code)) if pattern else chr(code)
        elif pattern:
            return found[0]
        elif other in "\"'\\":
            return other
        elif other in _SINGLE:
            return _SINGLE[other]
        at = start + found.start()
        raise FilterError(f"{found[0]} is no escape; a backslash is written \\\\", text, at, at + len(found[0]))

    return _ESCAPE.sub(one, written)


def text_bytes(node: QuotedText, text: str) -> bytes:
    """Return the bytes that a text in a filter stands for, UTF-8. Raises `FilterError`."""
    found = node.text.replace('\\"', '"') if node.raw else unescaped(node.text, text, node.span[0] + 1)
    try:
        return found.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:
        raise FilterError("half of a surrogate pair is no character", text, *node.span) from None


def text_value(node: QuotedText, text: str) -> str:
    r"""Return what a text in a filter stands for; its bytes that are no UTF-8 as fields show them: `\xNN`.

    Raises `FilterError`.
    """
    return text_bytes(node, text).decode("utf-8", "backslashreplace")


def moment(written: str, text: str, span: tuple[int, int]) -> Moment:
    """Return a time as it is written. Raises `FilterError`."""
    try:
        found = Moment.parse(written.removesuffix(" UTC") + ("Z" if written.endswith(" UTC") else ""))
    except ValueError as error:
        raise FilterError(str(error), text, *span) from None
    if found.kind == "since start":
        reason = "that counts from the first frame: compare it with frame.time_relative"
        raise FilterError(reason, text, *span)
    return found


def pattern_test(node: QuotedText, text: str) -> Callable[[CodedWords | ByteSpans], Array]:
    """Return what finds the texts or bytes that a regular expression matches somewhere, whatever their capitals.

    The time it takes grows with the length of a text and of the pattern, never faster: the expressions are those of
    RE2, which has no look-ahead and no back references. Raises `FilterError`.
    """
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.compute as pc  # noqa: PLC0415 - few filters have patterns, and it is large

    if len(node.text) > MOST_PATTERN:
        raise FilterError(f"a pattern has at most {MOST_PATTERN} characters", text, *node.span)
    pattern = node.text.replace('\\"', '"') if node.raw else _pattern(node, text)

    def matched(array: pa.Array) -> Array:
        return np.asarray(pc.match_substring_regex(array, pattern, ignore_case=True))

    try:
        matched(pa.array(["x"]))
    except pa.ArrowInvalid as error:
        why = str(error).rpartition("expression: ")[2] or str(error)
        why = _UNKNOWN.get(why.rpartition(": ")[0], why)
        raise FilterError(f"this is no regular expression: {why}", text, *node.span) from None

    def test(data: CodedWords | ByteSpans) -> Array:
        if isinstance(data, CodedWords):
            found = matched(pa.array(list(data.words), pa.string())) if len(data.words) else np.zeros(1, bool)
            return found[data.codes]
        return matched(pa.array(data.each(), pa.binary()))

    return test


def _pattern(node: QuotedText, text: str) -> str:
    kept = node.text.replace('\\"', '"')
    return unescaped(kept, text, node.span[0] + 1, pattern=True) if "\\u" in kept or "\\U" in kept else kept


def spelled(unit: str) -> str:
    """Return a unit as profiles write it."""
    unit = unit.replace("\u00b5", "u").replace("\u03bc", "u")
    return _SPELLED.get(unit, unit)


def base(unit: str) -> tuple[str, Fraction]:
    """Return the unit without a prefix, and how much of it one is: `mV` is V, 1/1000."""
    unit = spelled(unit)
    if unit in _OTHER:
        return _OTHER[unit]
    for prefix, power in _PREFIXES.items():
        if prefix and unit.startswith(prefix) and unit.removeprefix(prefix) in _SCALED:
            return unit.removeprefix(prefix), Fraction(10) ** power
    return unit, Fraction(1)


def factor(unit: str, wanted: str) -> Fraction | None:
    """Return what a number in `unit` has to be multiplied by to be in the unit `wanted`; None if that is another."""
    (one, many), (other, each) = base(unit), base(wanted)
    return many / each if one == other else None


def folded(word: str) -> str:
    """Return a word as it is compared with others: capitals, lines and spaces tell nothing."""
    return " ".join(word.lower().replace("_", " ").replace("-", " ").split())
