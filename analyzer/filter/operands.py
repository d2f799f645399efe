"""Values in filters, checked: fields, pieces of them, arithmetic, functions, and constants made to fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.filter.arithmetic import calculated, divided, masked, rest, signed
from analyzer.filter.comparing import words_of
from analyzer.filter.constants import ARITHMETIC, LITERALS, Constants, said
from analyzer.filter.fields import TEXT, Kind
from analyzer.filter.language.errors import FilterError, listed, near
from analyzer.filter.language.literals import text_value
from analyzer.filter.language.syntax import Arithmetic, BareWord, Call, Number, QuotedText, Sign, Slice
from analyzer.filter.nodes import ConstantNode, FieldNode, LagNode, MappedNode, PairNode, RowNode, ValueNode
from analyzer.filter.slices import byte_values, cut, lengths, nowhere
from dissectors.records import replace
from dissectors.times import SECOND

if TYPE_CHECKING:
    from analyzer.filter.fields import FieldRef
    from analyzer.filter.language.syntax import Syntax
    from analyzer.filter.names import FilterNames

LONGEST_LAG = 600 * SECOND
MOST_LAGS = 16
FUNCTIONS = ("max", "min", "abs", "len", "count", "lower", "upper", "lag")
TESTS = ("within", "exists")


class Operands(Constants):
    """Makes values of a syntax tree, and constants that fit them; `lags` are those that look back.

    Args:
        text: the filter, for places in errors.
        names: what names mean.
    """

    def __init__(self, text: str, names: FilterNames) -> None:
        super().__init__(text, names)
        self.lags: list[LagNode] = []
        self._made: dict[int, tuple[Syntax, ValueNode]] = {}  # asked for more than once at every level of a tree

    # ---- values that rows have

    def make(self, node: Syntax) -> ValueNode:
        """Return the values of a tree that is no constant. Raises `FilterError`."""
        if id(node) not in self._made:
            self._made[id(node)] = node, self._value(node)
        return self._made[id(node)][1]

    def _value(self, node: Syntax) -> ValueNode:
        if isinstance(node, BareWord):
            return FieldNode(self.names.find(node.text, self.text, node.span[0]))
        if isinstance(node, Slice):
            return self._slice(node)
        if isinstance(node, Call):
            return self._call(node)
        if isinstance(node, Sign):
            of = self.number(node.of)
            return MappedNode(of, _unbound(of.kind), lambda values: values.with_data(-signed(values.plain)))
        if isinstance(node, Arithmetic):
            return self._arithmetic(node)
        if isinstance(node, LITERALS):
            raise self.fail("a field is expected here, not a value alone", node)
        raise self.fail("a value is expected here, not a condition", node)

    def number(self, node: Syntax) -> ValueNode:
        """Return values that can be added; a piece of one byte is a number. Raises `FilterError`."""
        found = self.make(node)
        if found.kind.sort == "bytes" and isinstance(node, Slice) and found.kind.size == 1:
            return MappedNode(found, Kind("number", low=0, high=255, whole=True, octet=True), byte_values)
        if not found.kind.numeric or (found.kind.sort == "number" and found.kind.closed and found.kind.texts):
            if found.kind.numeric:
                return found
            raise self.fail(f"this is {said(found.kind)}: it cannot be calculated with", node)
        if found.kind.special:
            special = found.kind.special
            return MappedNode(found, found.kind, lambda v: v.with_data(v.data, ~np.isin(v.plain, special)))
        return found

    def _slice(self, node: Slice) -> ValueNode:
        of = self.make(node.of)
        if isinstance(of, FieldNode) and of.ref.origin == "type":
            raise self.fail(f"{of.ref.name} is a type: only its fields have pieces, {of.ref.name}.FIELD", node)
        made = cut(of, node.pieces)
        if made is None:
            raise self.fail(f"this is {said(of.kind)}: only bytes, text and lists have pieces", node)
        if reason := nowhere(of.kind, node.pieces):
            raise self.fail(reason, node)
        return made

    def _arithmetic(self, node: Arithmetic) -> ValueNode:
        left, right = self._pair(node)
        unit = left.kind.unit or right.kind.unit
        whole = left.kind.whole and right.kind.whole
        if node.op == "&":
            for side, of in ((left, node.left), (right, node.right)):
                if not side.kind.whole and side.kind.sort != "flag":
                    raise self.fail("bits are taken of whole numbers only", of)
            kind = Kind("number", whole=True, mask=-1, octet=left.kind.octet or right.kind.octet)
            return PairNode(left, right, kind, lambda a, b: (masked(a, b), None))
        if node.op in ("+", "-") and left.kind.unit and right.kind.unit and left.kind.unit != right.kind.unit:
            raise self.fail(f"{left.kind.unit} and {right.kind.unit} cannot be added", node)
        if node.op in ("*", "/") and left.kind.unit and right.kind.unit:
            unit = (
                ""
                if node.op == "/" and left.kind.unit == right.kind.unit
                else f"{left.kind.unit}{node.op}{right.kind.unit}"
            )
        kind = Kind("number", unit=unit, whole=whole)
        if node.op in ARITHMETIC:
            make = ARITHMETIC[node.op]
            return PairNode(left, right, kind, lambda a, b: (calculated(make, a, b), None))
        if isinstance(right, ConstantNode) and right.value == 0:
            raise self.fail("nothing is divided by 0", node.right)
        return PairNode(left, right, kind, divided if node.op == "/" else rest)

    def _pair(self, node: Arithmetic) -> tuple[ValueNode, ValueNode]:
        """Return both sides, constants in the unit of the other side where that has to be the same."""
        same = node.op in ("+", "-", "%")
        constant = [self.constant(side) for side in (node.left, node.right)]
        if node.op == "&":  # bits of a byte are written as a byte is
            for place, (side, other) in enumerate(((node.left, node.right), (node.right, node.left))):
                one = self.octet(side)
                if one is not None and constant[1 - place] is None and self.number(other).kind.octet:
                    constant[place] = one
        if constant[0] is not None and constant[1] is not None:
            raise self.fail("a calculation needs a field", node)
        sides: list[ValueNode] = []
        for side, value, other in zip((node.left, node.right), constant, (node.right, node.left), strict=True):
            if value is None:
                sides.append(self.seconds(self.number(side)))
                continue
            peer = self.seconds(self.number(other)).kind
            unit = Kind("number", unit=peer.unit if same or value.unit else "")
            if value.unit and not same:
                unit = Kind("number", unit=value.unit)
            number = self.scaled(value, unit)
            sides.append(
                ConstantNode(replace(unit, unit=value.unit and unit.unit, whole=isinstance(number, int)), number)
            )
        return sides[0], sides[1]

    def measured(self, ref: FieldRef, node: Syntax) -> None:
        """Raise `FilterError` for a unit behind a number where a field has none, and one beside it has such."""
        if ref.kind.unit or not isinstance(node, Number) or not node.unit:
            return
        if other := self.names.measured(ref, node.unit):
            reason = f"{node.unit} does not fit: the field has no unit; did you mean {other}?"
            raise self.fail(reason, node, (other,))

    def parted(self, ref: FieldRef, node: Syntax) -> None:
        """Raise `FilterError` for a word that a number has none of, if it is a part of it or what a part can be."""
        if ref.kind.sort != "number" or ref.kind.texts or not isinstance(node, (BareWord, QuotedText)):
            return
        word = node.text if isinstance(node, BareWord) else text_value(node, self.text)
        if parts := self.names.parts(ref, word):
            raise self.fail(f"the field is {said(ref.kind)}, not text; did you mean {listed(parts)}?", node, parts)

    def seconds(self, of: ValueNode) -> ValueNode:
        """Return times as seconds, everything else as it is."""
        if of.kind.sort != "duration":
            return of
        kind = Kind("number", unit="s")
        return MappedNode(of, kind, lambda values: values.with_data(values.plain / SECOND))

    # ---- functions

    def _call(self, node: Call) -> ValueNode:
        name, given = node.name, node.given
        if name in TESTS:
            raise self.fail(f"{name}() is a condition, not a value", node)
        if name not in FUNCTIONS:
            meant = near(name, [*FUNCTIONS, *TESTS])
            hint = f"did you mean {listed(meant)}?" if meant else f"there are {', '.join((*FUNCTIONS, *TESTS))}"
            raise FilterError(
                f"no function is called {name!r}; {hint}", self.text, node.span[0], node.span[0] + len(name), meant
            )
        wanted = {"lag": "2 values", "max": "", "min": ""}.get(name, "1 value")
        if (wanted and len(given) != int(wanted[0])) or not given:
            raise self.fail(f"{name}() takes {wanted or 'at least 1 value'}, not {len(given)}", node)
        made = {"lag": self._lag, "max": self._extreme, "min": self._extreme, "abs": self._abs, "count": self._count}
        return made.get(name, self._of_text)(node)

    def _extreme(self, node: Call) -> ValueNode:
        every = tuple(self._given(one, node.given) for one in node.given)
        unit = next((one.kind.unit for one in every if one.kind.unit), "")
        for one, of in zip(every, node.given, strict=True):
            if one.kind.unit not in ("", unit):
                raise self.fail(f"this is in {one.kind.unit}, the others in {unit}", of)
        return RowNode(node.name, every, Kind("number", unit=unit, whole=all(one.kind.whole for one in every)))

    def _abs(self, node: Call) -> ValueNode:
        of = self.seconds(self.number(node.given[0]))
        return MappedNode(of, _unbound(of.kind), lambda values: values.with_data(np.abs(signed(values.plain))))

    def _count(self, node: Call) -> ValueNode:
        return RowNode("count", (self.make(node.given[0]),), Kind("number", whole=True))

    def _of_text(self, node: Call) -> ValueNode:
        of = self.make(node.given[0])
        if node.name == "len":
            if of.kind.sort not in ("text", "bytes"):
                raise self.fail(f"this is {said(of.kind)}: only text and bytes have a length", node.given[0])
            return MappedNode(of, Kind("number", whole=True), lengths)
        if of.kind.sort != "text":
            raise self.fail(f"this is {said(of.kind)}, not text", node.given[0])
        change = str.lower if node.name == "lower" else str.upper
        return MappedNode(of, TEXT, lambda values: values.with_data(words_of(values).changed(change)))

    def _given(self, node: Syntax, among: tuple[Syntax, ...]) -> ValueNode:
        """Return one of several values of a function; constants are in the unit of those that are fields."""
        constant = self.constant(node)
        if constant is None:
            return self.seconds(self.number(node))
        fields = [one for one in among if self.constant(one) is None]
        if not fields:
            raise self.fail("a field is expected among these", node)
        kind = Kind("number", unit=self.seconds(self.number(fields[0])).kind.unit)
        value = self.scaled(constant, kind)
        return ConstantNode(replace(kind, whole=isinstance(value, int)), value)

    def _lag(self, node: Call) -> ValueNode:
        of, ago = self.make(node.given[0]), node.given[1]
        if not isinstance(of, FieldNode) or of.ref.origin != "table" or not of.kind.numeric:
            raise self.fail("lag() looks back at a number of a message, TYPE.FIELD", node.given[0])
        if not isinstance(ago, Number):
            raise self.fail("lag() takes a time, such as 5 s", ago)
        ns = int(self.scaled(ago, Kind("duration", unit="s")))
        if not 0 < ns <= LONGEST_LAG:
            raise self.fail(f"lag() looks back at most {LONGEST_LAG // SECOND} s", ago)
        if len(self.lags) >= MOST_LAGS:
            raise self.fail(f"a filter looks back at most {MOST_LAGS} times", node)
        found = LagNode(of, ns, len(self.lags))
        self.lags.append(found)
        return found


def _unbound(kind: Kind) -> Kind:
    return Kind("number", unit=kind.unit, whole=kind.whole)
