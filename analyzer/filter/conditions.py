"""Conditions in filters, checked: what is compared with what, and how."""

from __future__ import annotations

from itertools import pairwise, takewhile
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from analyzer.filter.apart import apart, carriers
from analyzer.filter.comparing import OPERATORS, bytes_test, in_words, membership, octets_of, of_pairs, words_of
from analyzer.filter.constants import LITERALS, said
from analyzer.filter.language.errors import listed
from analyzer.filter.language.literals import pattern_test, text_bytes, text_value
from analyzer.filter.language.syntax import (
    Arithmetic,
    BareWord,
    Call,
    Comparison,
    Logic,
    Members,
    Not,
    Number,
    QuotedText,
    Slice,
    ValueRange,
)  # fmt: skip
from analyzer.filter.nodes import (
    ComparisonOf,
    Condition,
    ConstantNode,
    FieldNode,
    Junction,
    MappedNode,
    Negation,
    Present,
    ValueNode,
    ValueTest,
    moment_set,
    moment_test,
)  # fmt: skip
from analyzer.filter.operands import TESTS, Operands
from dissectors.records import replace

if TYPE_CHECKING:
    from analyzer.filter.language.syntax import Syntax
    from analyzer.filter.names import FilterNames
    from dissectors.kit import Array

_TURNED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}


class Conditions:
    """Makes conditions of a syntax tree.

    Args:
        text: the filter, for places in errors.
        names: what names mean.
        across: fields of other messages have a value in each row, that which was told last.

    Attributes:
        words: texts that fields are compared with whose words only a capture or its rules know.
    """

    def __init__(self, text: str, names: FilterNames, *, across: bool = False) -> None:
        self.operands = Operands(text, names)
        self.words: list[AskedWord] = []
        self._text, self._across = text, across

    def make(self, node: Syntax) -> Condition:
        """Return the condition of a tree. Raises `FilterError`."""
        if isinstance(node, Logic):
            self._no_list(node)
            return Junction(tuple(self.make(term) for term in node.terms), both=node.op == "and")
        if isinstance(node, Not):
            return Negation(self.make(node.of))
        if isinstance(node, Comparison):
            return self._of_one_row(self._comparison(node), node)
        if isinstance(node, Call) and node.name in TESTS:
            return self._of_one_row(self._within(node), node) if node.name == "within" else self._exists(node)
        if isinstance(node, Arithmetic) and node.op == "&":
            return ValueTest(self.operands.make(node), lambda values: values.plain != 0, every=False)
        if isinstance(node, (BareWord, Slice)):
            return Present(self.operands.make(node))
        if isinstance(node, Call):
            self.operands.make(node)
        if isinstance(node, LITERALS):
            raise self.operands.fail("a value alone is no condition: compare a field with it", node)
        if isinstance(node, (ValueRange, Members)):
            raise self.operands.fail("a set stands behind in", node)
        raise self.operands.fail("this is a value, not a condition: compare it with something", node)

    def _no_list(self, node: Logic) -> None:
        """Raise `FilterError` for `x == 1 or 2`."""
        for k, (before, term) in enumerate(pairwise(node.terms), 1):
            if node.op == "or" and isinstance(term, LITERALS) and isinstance(before, Comparison) and before.op == "==":
                rest = takewhile(lambda one: isinstance(one, LITERALS), node.terms[k:])
                name, *values = (self._text[slice(*of.span)] for of in (before.left, before.right, *rest))
                instead = f"{name} in {{{', '.join(values)}}}"
                raise self.operands.fail(f"a value alone is no condition: write {instead:.80}", term, (instead,))

    def _of_one_row(self, made: Condition, node: Syntax) -> Condition:
        """Return a condition. Raises `FilterError` if no row has all the fields that it compares."""
        if not self._across and carriers(made, self.operands.names.registry) == frozenset():
            raise self.operands.fail(apart(made), node)
        return made

    def _exists(self, node: Call) -> Condition:
        if len(node.given) != 1:
            raise self.operands.fail("exists() takes one field", node)
        of = self.operands.make(node.given[0])
        is_type = isinstance(of, FieldNode) and of.ref.origin == "type"  # a flag of every row
        return Present(of, exists=not is_type)

    def _within(self, node: Call) -> Condition:
        """Return `|a - b| <= tolerance`, that being a share of b or a number in its unit."""
        if len(node.given) != 3:
            raise self.operands.fail("within(a, b, tolerance) takes three values", node)
        a, b, tolerance = node.given
        share = isinstance(tolerance, Number) and tolerance.unit == "%"
        left = self.operands.number(a)
        kind = replace(left.kind, low=None, high=None, texts={}, closed=False, whole=False)
        right = ConstantNode(kind, self.operands.fit(b, kind)) if self.operands.literal(b) else self.operands.number(b)
        self._alike(left, right, node)
        if not isinstance(tolerance, Number):
            raise self.operands.fail("the tolerance is a number, such as 10 % or 0.5 V", tolerance)
        if tolerance.value < 0:
            raise self.operands.fail("a tolerance is not below 0", tolerance)
        allowed = float(tolerance.value) / 100 if share else self.operands.fit(tolerance, kind)

        def holds(one: Any, other: Any) -> Array:
            one, other = np.asarray(one, np.float64), np.asarray(other, np.float64)
            found: Array = np.abs(one - other) <= (np.abs(other) * allowed if share else allowed)
            return found

        return ComparisonOf(left, right, holds, every=False)

    # ---- comparisons

    def _comparison(self, node: Comparison) -> Condition:
        left, right, op = node.left, node.right, node.op
        if op == "in":
            return self._member(node)
        if op in ("contains", "matches"):
            return self._search(node)
        if self.operands.literal(left):
            if self.operands.literal(right):
                if isinstance(left, BareWord) or isinstance(right, BareWord):
                    self.operands.make(left if isinstance(left, BareWord) else right)
                raise self.operands.fail("two values are compared here: one side has to be a field", node)
            if isinstance(left, BareWord) and isinstance(right, BareWord) and self._is_type(right):
                self.operands.make(left)
            left, right, op = right, left, _TURNED.get(op, op)
        of = self._side(left, op)
        if of.kind.sort == "text" and isinstance(right, Arithmetic):  # TRF-003 is one, as it is written
            raise self.operands.fail("the field is text: put what it is compared with in double quotes", right)
        if self.operands.literal(right) or self._constant(right) or (isinstance(right, BareWord) and names_type(of)):
            return self._with_constant(of, right, op, every=node.every)
        other = self._side(right, op)
        of, other = self._alike(of, other, node)
        return ComparisonOf(of, other, of_pairs(op), every=node.every)

    def _is_type(self, node: BareWord) -> bool:
        return self.operands.names.find(node.text, self._text, node.span[0]).origin == "type"

    def _constant(self, node: Syntax) -> bool:
        return self.operands.constant(node) is not None

    def _side(self, node: Syntax, op: str) -> ValueNode:
        """Return a side of a comparison; an order asks for numbers that are some."""
        of = self.operands.make(node)
        if isinstance(of, FieldNode) and of.ref.origin == "type":
            name = of.ref.name
            fields = list(self.operands.names.with_ending(name.lower()))
            instead = f", or {listed(fields)}" if fields else ""
            known = len(of.ref.tables) > 1 or of.ref.tables[0].startswith(name)
            of_what = "a type" if known else f"the type {of.ref.tables[0]}"
            raise self.operands.fail(f"{name} is {of_what}: compare one of its fields, {name}.FIELD{instead}", node)
        if op in _TURNED and of.kind.special:
            special = of.kind.special
            return MappedNode(of, of.kind, lambda v: v.with_data(v.data, ~np.isin(v.plain, special)))
        return of

    def _alike(self, left: ValueNode, right: ValueNode, node: Syntax) -> tuple[ValueNode, ValueNode]:
        """Return two sides that can be compared with each other. Raises `FilterError` if they cannot."""
        one, other = left.kind, right.kind
        numeric = one.numeric and other.numeric
        if not numeric and one.sort != other.sort:
            raise self.operands.fail(f"{said(one)} cannot be compared with {said(other)}", node)
        if numeric and one.unit and other.unit and one.unit != other.unit:
            raise self.operands.fail(f"one side is in {one.unit}, the other in {other.unit}", node)
        if one.sort == other.sort:
            return left, right
        return self.operands.seconds(left), self.operands.seconds(right)

    def _with_constant(self, of: ValueNode, right: Syntax, op: str, *, every: bool) -> Condition:
        kind = of.kind
        if kind.sort == "bytes" and isinstance(right, BareWord) and not self.operands.literal(right):
            raise self.operands.fail("bytes cannot be compared with a field", right)
        value = self._fit(right, of, code=op in ("==", "!="))
        compare = OPERATORS[op]
        if kind.sort == "moment":
            return moment_test(of, value, compare, every=every)
        if kind.sort == "text":
            return ValueTest(of, lambda values: words_of(values).those(lambda word: compare(word, value)), every=every)
        if kind.sort == "bytes":
            return ValueTest(of, lambda values: bytes_test(values, op, value), every=every)
        return ComparisonOf(of, ConstantNode(kind, value), compare, every=every)

    def _fit(self, node: Syntax, of: ValueNode, *, code: bool) -> Any:
        """Return a value that fits a side; with `code` it is one that the field can have, as far as that is known."""
        if isinstance(of, FieldNode):
            self.operands.measured(of.ref, node)
            self.operands.parted(of.ref, node)
        if not code or not isinstance(of, FieldNode) or of.kind.sort != "text":
            return self.operands.fit(node, of.kind, code=code)
        value = self.operands.fit(node, of.kind, code=True)
        if names_type(of):
            called, meant = self.operands.names.type_called(value)
            if not called:
                hint = f"; did you mean {listed(meant)}?" if meant else "; tailbyte fields lists them"
                raise self.operands.fail(f"no type is called {value!r:.60}{hint}", node, meant)
            return called
        if of.ref.origin in ("finding", "label", "frame") and not of.kind.closed:
            self.words.append(AskedWord(of.ref.name, value, node.span))
        return value

    def _member(self, node: Comparison) -> Condition:
        assert isinstance(node.right, Members)  # noqa: S101 - the grammar has nothing else
        if self.operands.literal(node.left):
            if isinstance(node.left, BareWord):
                self.operands.make(node.left)
            raise self.operands.fail("a field is expected here, not a value", node.left)
        of = self._side(node.left, "in")
        kind = of.kind
        singles, ranges = [], []
        for item in node.right.items:
            if isinstance(item, ValueRange):
                low, high = self.operands.fit(item.low, kind), self.operands.fit(item.high, kind)
                if kind.sort != "moment" and low > high:
                    raise self.operands.fail("the range ends below its start", item)
                ranges.append((low, high))
            else:
                singles.append(self._fit(item, of, code=True))
        if kind.sort == "moment":
            return moment_set(of, singles, ranges, every=node.every)
        return ValueTest(of, membership(kind, singles, ranges), every=node.every)

    def _search(self, node: Comparison) -> Condition:
        of, right = self.operands.make(node.left), node.right
        if isinstance(of, FieldNode) and of.kind.sort == "number" and of.kind.texts:
            of = in_words(of)
        if of.kind.sort not in ("text", "bytes"):
            raise self.operands.fail(f"this is {said(of.kind)}: {node.op} looks into text and bytes only", node.left)
        if node.op == "matches":
            if not isinstance(right, QuotedText):
                raise self.operands.fail("a pattern stands in double quotes", right)
            test = pattern_test(right, self._text)
            return ValueTest(of, lambda values: test(values.data), every=node.every)  # type: ignore[arg-type]
        if of.kind.sort == "text":
            if not isinstance(right, QuotedText):
                raise self.operands.fail("what a text contains stands in double quotes", right)
            part = text_value(right, self._text)
            return ValueTest(of, lambda values: words_of(values).those(lambda word: part in word), every=node.every)
        octets = text_bytes(right, self._text) if isinstance(right, QuotedText) else self.operands.fit(right, of.kind)
        return ValueTest(of, lambda values: octets_of(values).holding(octets), every=node.every)


class AskedWord(NamedTuple):
    """A text that a field is compared with, and where it stands in the filter."""

    field: str
    text: str
    span: tuple[int, int]


def names_type(of: ValueNode) -> bool:
    """Return whether this is the name of a transfer's type."""
    return isinstance(of, FieldNode) and (of.ref.origin, of.ref.column) == ("transfer", "type")
