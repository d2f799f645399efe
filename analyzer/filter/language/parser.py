"""The grammar of filters: operators by how strongly they bind, as wireshark-filter(4) has them."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from analyzer.filter.language.scanner import Scanner
from analyzer.filter.language.syntax import (
    Arithmetic,
    BareWord,
    Call,
    Comparison,
    Logic,
    Members,
    Not,
    Number,
    Octets,
    QuotedText,
    Sign,
    Slice,
    SlicePiece,
    ValueRange,
)  # fmt: skip

if TYPE_CHECKING:
    from fractions import Fraction
    from typing import NoReturn

    from analyzer.filter.language.scanner import FilterToken
    from analyzer.filter.language.syntax import Span, Syntax

MOST_NESTED = 100
MOST_TERMS = 20_000
_COMPARISONS = ("==", "!=", "===", "!==", "<", "<=", ">", ">=", "contains", "matches", "in")
_OR, _AND, _NOT, _COMPARED, _MASK, _SUM, _PRODUCT, _SIGN = range(1, 9)
_BINDS = {
    "or": _OR, "and": _AND, "not": _COMPARED, **dict.fromkeys(_COMPARISONS, _COMPARED), "&": _MASK, "+": _SUM,
    "-": _SUM, "*": _PRODUCT, "/": _PRODUCT, "%": _PRODUCT,
}  # fmt: skip
_BEGINS = ("word", "number", "text", "octets", "(", "+", "-")  # what an operand may begin with
_SAID = {"end": "the filter ends here", "word": "a name", "number": "a number", "text": "a text", "octets": "bytes"}


def parse(text: str) -> Syntax:
    """Return the tree of a filter. Raises `FilterError`."""
    return _Parser(text).whole()


class _Parser:
    def __init__(self, text: str) -> None:
        self._scanner = Scanner(text)
        self._token = self._scanner.next()
        self._depth = self._terms = self._chained = 0
        self._end = 0  # of the token before

    def whole(self) -> Syntax:
        if self._token.kind == "end":
            self._fail("the filter is empty")
        tree = self._expression(0)
        if self._token.kind != "end":
            apart = isinstance(tree, BareWord) and "." not in tree.text and self._token.kind == "word"
            self._unexpected("an operator such as && or ==" + (" (or the dot of a name)" if apart else ""))
        return tree

    def _fail(self, reason: str, token: FilterToken | None = None) -> NoReturn:
        token = token or self._token
        raise self._scanner.fail(reason, token.start, token.end)

    def _unexpected(self, wanted: str) -> NoReturn:
        token = self._token
        said = _SAID.get(token.kind, token.text)
        self._fail(f"{said}, but {wanted} is expected" if token.kind == "end" else f"{wanted} is expected, not {said}")

    def _next(self) -> FilterToken:
        token, self._end = self._token, self._token.end
        self._token = self._scanner.next()
        self._terms += 1
        if self._terms > MOST_TERMS:
            self._fail(f"a filter has at most {MOST_TERMS} words and marks")
        return token

    def _want(self, kind: str, wanted: str) -> FilterToken:
        if self._token.kind != kind:
            self._unexpected(wanted)
        return self._next()

    def _expression(self, least: int) -> Syntax:
        """Return what binds more strongly than `least`."""
        self._depth += 1
        if self._depth > MOST_NESTED:
            self._fail(f"a filter is nested at most {MOST_NESTED} deep")
        left = self._prefix()
        steps = 0
        while (binds := _BINDS.get(self._token.kind, 0)) > least:
            left = self._infix(left, binds)
            steps += binds > _COMPARED
            if steps > MOST_NESTED:
                self._fail(f"an expression has at most {MOST_NESTED} steps")
        self._depth -= 1
        return left

    # ---- what an expression begins with

    def _prefix(self) -> Syntax:
        token = self._token
        if token.kind == "not":
            self._next()
            of = self._expression(_NOT - 1)
            return Not(of, (token.start, self._end))
        if token.kind in ("any", "all"):
            return self._quantified()
        return self._postfix(self._operand())

    def _quantified(self) -> Syntax:
        token = self._next()
        left = self._expression(_COMPARED)
        if isinstance(left, (Comparison, Logic, Not)):
            raise self._scanner.fail(f"{token.text} stands in front of a field, without parentheses", *left.span)
        if _BINDS.get(self._token.kind) != _COMPARED:
            self._unexpected(f"a comparison behind {token.text}")
        return self._comparison(left, token)

    def _operand(self) -> Syntax:
        token = self._token
        if token.kind not in _BEGINS:
            self._unexpected("a field, a value or a parenthesis")
        self._next()
        place = (token.start, token.end)
        if token.kind == "(":
            inside = self._expression(0)
            self._want(")", "a closing parenthesis")
            return inside
        if token.kind in ("-", "+"):
            return self._signed(token)
        if token.kind == "word":
            return self._call(token) if self._token.kind == "(" else BareWord(token.text, place)
        return self._literal(token, place)

    def _literal(self, token: FilterToken, place: Span) -> Syntax:
        if token.kind == "text":
            return QuotedText(token.text, token.unit == "r", place)
        return self._number(token) if token.kind == "number" else Octets(cast("bytes", token.value), place)

    def _signed(self, token: FilterToken) -> Syntax:
        of = self._expression(_SIGN)
        if isinstance(of, Number):
            sign = -1 if token.kind == "-" else 1
            return Number(token.text + of.text, sign * of.value, of.unit, (token.start, self._end))
        return Sign(of, (token.start, self._end)) if token.kind == "-" else of

    def _number(self, token: FilterToken) -> Number:
        """Return a number; a `%` behind it is per cent unless something to divide by follows."""
        value, unit = cast("int | Fraction", token.value), token.unit
        if not unit and self._token.text == "%":
            mark = self._next()
            if self._token.kind in _BEGINS:
                return self._remainder(token, mark)
            unit = "%"
        return Number(token.text, value, unit, (token.start, self._end))

    def _remainder(self, token: FilterToken, mark: FilterToken) -> Number:
        self._fail("behind a number % is per cent: for the remainder write mod", mark)
        return Number(token.text, 0)

    def _call(self, name: FilterToken) -> Call:
        self._next()
        given: list[Syntax] = []
        while self._token.kind != ")":
            if given:
                self._want(",", "a comma or a closing parenthesis")
            given.append(self._expression(0))
        self._next()
        return Call(name.text, tuple(given), (name.start, self._end))

    def _postfix(self, of: Syntax) -> Syntax:
        steps = 0
        while self._token.kind == "[":
            steps += 1
            if steps > MOST_NESTED:
                self._fail(f"an expression has at most {MOST_NESTED} steps")
            start = of.span[0]
            pieces = tuple(self._piece(*piece) for piece in self._scanner.pieces())
            end = self._scanner.at
            self._next()
            self._end = end
            of = Slice(of, pieces, (start, end))
        return of

    def _piece(self, low: int | None, mark: str, high: int | None, start: int, end: int) -> SlicePiece:
        if not mark:
            return SlicePiece(low or 0, 1, single=True)
        if mark == ":":
            if high is not None and high <= 0:
                raise self._scanner.fail("behind the colon stands a length of at least 1", start, end)
            return SlicePiece(low or 0, high)
        if low is None or high is None or (low >= 0 and 0 <= high < low):
            raise self._scanner.fail("the end of a range lies behind its start", start, end)
        return SlicePiece(low, end=high)

    # ---- what follows

    def _infix(self, left: Syntax, binds: int) -> Syntax:
        if binds == _COMPARED:
            return self._comparison(left, None)
        if binds <= _AND:
            op, terms = self._token.kind, [left]
            while self._token.kind == op:
                self._next()
                terms.append(self._expression(binds))
            flat = [t for term in terms for t in (term.terms if isinstance(term, Logic) and term.op == op else (term,))]
            return Logic(op, tuple(flat), (left.span[0], self._end))
        op = self._next().text
        right = self._expression(binds)
        op = {"bitwise_and": "&", "mod": "%"}.get(op, op)
        return Arithmetic(op, left, right, (left.span[0], self._end))

    def _comparison(self, left: Syntax, quantifier: FilterToken | None) -> Syntax:
        token = self._next()
        negated = token.kind == "not"
        if negated:
            if self._token.kind != "in":
                self._fail("not stands in front of a condition (&& not x == 3) or of in (x not in {1, 3..5})", token)
            token = self._next()
        op = token.kind
        right = self._members() if op == "in" else self._expression(_COMPARED)
        every = op in ("!=", "===")
        op = {"===": "==", "!==": "!="}.get(op, op)
        if quantifier is not None:
            every = quantifier.kind == "all"
        span = ((quantifier.start if quantifier else left.span[0]), self._end)
        found: Syntax = Comparison(op, left, right, every, span)
        found = Not(found, span) if negated else found
        if _BINDS.get(self._token.kind) == _COMPARED:
            if self._token.kind in ("in", "not", "contains", "matches") or op in ("in", "contains", "matches"):
                self._fail("a comparison ends here: && or || is expected")
            if isinstance(right, Arithmetic) and right.op == "&":
                raise self._scanner.fail("& takes bits of numbers: to join conditions write &&", *right.span)
            self._chained += 1
            if self._chained > MOST_NESTED:
                self._fail(f"an expression has at most {MOST_NESTED} steps")
            return Logic("and", (found, self._comparison(right, quantifier)), (span[0], self._end))
        return found

    def _members(self) -> Members:
        start = self._want("{", "a set in braces, such as {1, 3..5}").start
        items: list[Syntax] = []
        while self._token.kind != "}":
            if items:
                self._want(",", "a comma or a closing brace")
            low = self._expression(_COMPARED)
            if self._token.kind == "..":
                dots = self._next()
                if self._token.text.startswith(".") and self._token.start == dots.end:
                    raise self._scanner.fail("a range has two dots, such as 3..5", dots.start, dots.end + 1)
                high = self._expression(_COMPARED)
                items.append(ValueRange(low, high, (low.span[0], self._end)))
            else:
                items.append(low)
        end = self._next().end
        if not items:
            raise self._scanner.fail("the set is empty: it holds values such as {1, 3..5}", start, end)
        return Members(tuple(items), (start, end))
