"""Constants in filters, made to fit what they are compared with: numbers with units, words, flags, bytes, times."""

from __future__ import annotations

import math
import operator
import re
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from analyzer.filter.fields import Kind
from analyzer.filter.language.errors import FilterError, listed, near
from analyzer.filter.language.literals import factor, folded, moment, text_bytes, text_value
from analyzer.filter.language.syntax import Arithmetic, BareWord, Number, Octets, QuotedText
from analyzer.window.limits import Moment
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.filter.language.syntax import Syntax
    from analyzer.filter.names import FilterNames

ARITHMETIC = {"+": operator.add, "-": operator.sub, "*": operator.mul}
LITERALS = (Number, QuotedText, Octets)
_NUMBER = re.compile(r"\s*[-+]?[\d.]")
_OCTET = re.compile(r"(?:0[xX])?[0-9A-Fa-f]{2}")
_TRUE, _FALSE = ("true", "set", "yes"), ("false", "unset", "no")


class Constants:
    """Makes constants of a syntax tree.

    Args:
        text: the filter, for places in errors.
        names: what names mean.
    """

    def __init__(self, text: str, names: FilterNames) -> None:
        self.text, self.names = text, names

    def fail(self, reason: str, node: Syntax, candidates: Sequence[str] = ()) -> FilterError:
        """Return an error about the place of a node."""
        return FilterError(reason, self.text, *node.span, candidates)

    def literal(self, node: Syntax) -> bool:
        """Return whether this is a value as it is written, or a word that is no field."""
        return isinstance(node, LITERALS) or (isinstance(node, BareWord) and not self._is_field(node))

    def _is_field(self, node: BareWord) -> bool:
        try:
            self.names.find(node.text, self.text, node.span[0])
        except FilterError:
            return False
        return True

    def constant(self, node: Syntax) -> Number | None:
        """Return a number that is written, or calculated of those."""
        if isinstance(node, Number):
            return node
        if isinstance(node, Arithmetic):
            left, right = self.constant(node.left), self.constant(node.right)
            if left is not None and right is not None and not left.unit and not right.unit:
                return Number(self.text[slice(*node.span)], self._folded(node, left.value, right.value), "", node.span)
        return None

    def _folded(self, node: Arithmetic, a: int | Fraction, b: int | Fraction) -> int | Fraction:
        if node.op in ("/", "%") and not b:
            raise self.fail("nothing is divided by 0", node.right)
        if node.op == "&":
            if not (isinstance(a, int) and isinstance(b, int)):
                raise self.fail("bits are taken of whole numbers only", node)
            return a & b
        if node.op in ("/", "%"):
            exact = Fraction(a) / Fraction(b)
            whole = math.trunc(exact)
            quotient = whole if isinstance(a, int) and isinstance(b, int) else exact
            return quotient if node.op == "/" else a - b * whole
        found: int | Fraction = ARITHMETIC[node.op](a, b)
        return found

    def fit(self, node: Syntax, kind: Kind, *, code: bool = False) -> Any:
        """Return a value as it is written as one of a kind; with `code` it has to be one that the field can have.

        A number, text, bytes, a flag or a moment. Raises `FilterError`.
        """
        if kind.sort == "text":
            return self._text(node, kind, code=code)
        if kind.numeric and kind.sort != "flag":
            return self._number(node, kind, code=code)
        if kind.sort == "bytes":
            return self._sized(self._bytes(node), kind, node) if code and kind.size else self._bytes(node)
        return self._flag(node) if kind.sort == "flag" else self._moment(node)

    def _sized(self, found: bytes, kind: Kind, node: Syntax) -> bytes:
        """Return bytes that a piece may be. Raises `FilterError` for more or fewer than it has."""
        if len(found) != kind.size:
            few, many = len(found), f"{kind.size} byte{'s' * (kind.size > 1)}"
            raise self.fail(f"the piece has {many}, this has {few}: a piece of {few} is [4:{few}] (start:length)", node)
        return found

    def _moment(self, node: Syntax) -> Moment:
        if isinstance(node, QuotedText):
            return moment(text_value(node, self.text), self.text, node.span)
        number = self.constant(node)
        if number is None:
            raise self.fail('a time is written "12:49:54.89" or "2026-03-14 12:49:54.89", with the quotes', node)
        return Moment("absolute", int(self.scaled(number, Kind("duration", unit="s"))))

    def octet(self, node: Syntax) -> Number | None:
        """Return one byte as it is written, two hexadecimal digits as a number; None for anything else."""
        written = self.text[slice(*node.span)].strip()
        if isinstance(node, (Number, BareWord)) and _OCTET.fullmatch(written):
            return Number(written, int(written, 16), "", node.span)
        return None

    def _number(self, node: Syntax, kind: Kind, *, code: bool) -> float:
        number = (self.octet(node) if kind.octet else None) or self.constant(node)
        if number is None:
            return self._named(node, kind)
        found = self.scaled(number, kind)
        self._possible(node, found, kind, code=code)
        return found

    def scaled(self, number: Number, kind: Kind) -> int | float:
        """Return a number in the unit of a kind, durations in nanoseconds. Raises `FilterError` for another unit."""
        value: int | Fraction = number.value
        if number.unit and number.unit != kind.unit:
            times = factor(number.unit, kind.unit) if kind.unit else None
            if times is None:
                if number.unit == "%":
                    own = f"is in {kind.unit}" if kind.unit else "has no unit"
                    raise self.fail(
                        f"% behind a number is per cent, and the field {own}: for the remainder write mod", number
                    )
                written = self.text[slice(*number.span)]
                if len(written) > 2 and set(written.lower()) <= set("0123456789abcdef"):
                    raise self.fail(f"a number in hexadecimal is written 0x{written}", number, (f"0x{written}",))
                own = f"the field is in {kind.unit}" if kind.unit else "the field has no unit"
                raise self.fail(f"{number.unit} does not fit: {own}", number, (kind.unit,) if kind.unit else ())
            value = value * times
        if kind.sort == "duration":
            value = value * SECOND
        if isinstance(value, Fraction):
            if kind.sort == "duration" or value.denominator == 1:
                value = value.numerator // value.denominator
            else:
                return float(value)
        if not -(1 << 63) <= value < 1 << 64:
            raise self.fail("no field holds a number as large", number)
        return value

    def _possible(self, node: Syntax, value: float, kind: Kind, *, code: bool) -> None:
        if code and kind.closed and kind.texts and value not in kind.texts:
            raise self.fail(f"{value} is none of its values: {listed(_codes(kind))}", node, _codes(kind))
        if code and kind.whole and isinstance(value, float):
            raise self.fail(f"{digits(value)} is not possible: this is a whole number", node)
        if kind.low is None or kind.high is None:
            return
        if not (kind.low if code else min(kind.low, 0)) <= value <= kind.high:
            hint = "; a range is written 3..5" if isinstance(node, Arithmetic) and node.op == "-" else ""
            raise self.fail(f"{value} is not possible: the field holds {int(kind.low)} to {int(kind.high)}{hint}", node)

    def _named(self, node: Syntax, kind: Kind) -> float:
        """Return the number that a word stands for."""
        word = (
            node.text
            if isinstance(node, BareWord)
            else text_value(node, self.text)
            if isinstance(node, QuotedText)
            else None
        )
        if word is None:
            raise self.fail(f"this is compared with {said(kind)}", node)
        if not kind.texts:
            if isinstance(node, BareWord):
                raise self._no_value(node, kind)
            bare = isinstance(node, QuotedText) and _NUMBER.match(word)
            hint = "; a number stands without quotes" if bare and kind.sort == "number" else ""
            hint = ", such as 1.5 s" if bare and kind.sort == "duration" else hint
            raise self.fail(f"the field is {said(kind)}, not text{hint}", node)
        for value, words in kind.texts.items():
            if folded(word) in map(folded, words):
                return value
        names = [words[0] for words in kind.texts.values()]
        raise self.fail(f"{word!r} is none of its values: {listed(_codes(kind))}", node, near(word, names) or names)

    def _no_value(self, node: BareWord, kind: Kind) -> FilterError:
        """Return why a word is not a number: it is a field, the name of one mistyped, or neither."""
        try:
            self.names.find(node.text, self.text, node.span[0])
        except FilterError as error:
            if error.candidates:
                return error
            return self.fail(f"{node.text!r:.60} is neither a field nor a value: the field is {said(kind)}", node)
        return self.fail("a value is expected here, not a field", node)

    def _flag(self, node: Syntax) -> bool:
        number = self.constant(node)
        if number is not None and not number.unit and number.value in (0, 1):
            return bool(number.value)
        word = node.text.lower() if isinstance(node, (BareWord, QuotedText)) else ""
        if word not in _TRUE + _FALSE:
            raise self.fail("the field is a flag: it is 1 or 0, true or false", node, ("1", "0"))
        return word in _TRUE

    def _text(self, node: Syntax, kind: Kind, *, code: bool) -> str:
        if isinstance(node, BareWord):
            word = node.text
        elif isinstance(node, QuotedText):
            word = text_value(node, self.text)
        else:
            raise self.fail("the field is text: put what it is compared with in double quotes", node)
        if not (code and kind.closed):
            return word
        names = [words[0] for words in kind.texts.values()]
        for name in names:
            if folded(name) == folded(word):
                return name
        raise self.fail(f"{word!r} is none of its values: {listed(names)}", node, near(word, names) or names)

    def _bytes(self, node: Syntax) -> bytes:
        if isinstance(node, Octets):
            return node.value
        if isinstance(node, QuotedText):
            return text_bytes(node, self.text)
        if one := self.octet(node):
            return bytes([int(one.value)])
        raise self.fail("the field is bytes: they are written 0a:ff, one alone 0a or 0x0a", node)


def digits(value: float) -> str:
    """Return a number in digits, all that a float has."""
    return f"{value:.15g}"


def said(kind: Kind) -> str:
    """Return what a kind is called."""
    if kind.sort == "number":
        return f"a number in {kind.unit}" if kind.unit else "a number"
    return {"flag": "a flag", "text": "text", "bytes": "bytes", "moment": "a time", "duration": "a time in s"}[
        kind.sort
    ]


def _codes(kind: Kind) -> list[str]:
    return [f"{digits(value)} {words[0]}" for value, words in kind.texts.items()]
