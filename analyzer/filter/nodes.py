"""The tree that is evaluated: values of rows, and conditions on them, each with a type that has been checked."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from analyzer.filter.arithmetic import signed
from analyzer.filter.values import Values, any_row, every_row, joined

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from analyzer.filter.fields import FieldRef, Kind
    from analyzer.filter.rowsets import RowSet
    from analyzer.window.limits import Moment
    from dissectors.kit import Array

_COSTS = {"transfer": 1, "node": 1, "label": 2, "type": 2, "frame": 3, "finding": 4}
TABLES = 10  # the cost of what needs message tables


class ValueNode(ABC):
    """Something that rows have values of."""

    kind: Kind
    children: tuple[ValueNode, ...] = ()

    @abstractmethod
    def values(self, rows: RowSet) -> Values:
        """Return the values of all rows."""

    def fields(self) -> Iterator[FieldRef]:
        """Yield the fields that it is made of."""
        for child in self.children:
            yield from child.fields()


class ConstantNode(ValueNode):
    """A value that every row has, as a number of its column's scale, words or bytes."""

    def __init__(self, kind: Kind, value: object) -> None:
        self.kind, self.value = kind, value

    def values(self, rows: RowSet) -> Values:
        """Return it once a row."""
        return Values(None, np.full(rows.size, self.value))


class FieldNode(ValueNode):
    """A field as it is."""

    def __init__(self, ref: FieldRef) -> None:
        self.ref, self.kind = ref, ref.kind

    def values(self, rows: RowSet) -> Values:
        """Return what the rows have."""
        return rows.values(self.ref)

    def fields(self) -> Iterator[FieldRef]:
        """Yield the field."""
        yield self.ref


class LagNode(ValueNode):
    """A field some time ago, of the same sender; `place` is where the matcher keeps it."""

    def __init__(self, of: FieldNode, ago: int, place: int) -> None:
        self.of, self.ago, self.place = of, ago, place
        self.kind, self.children = of.kind, (of,)

    def values(self, rows: RowSet) -> Values:
        """Return what the field was."""
        return rows.lagged(self.place)


class MappedNode(ValueNode):
    """The result of a function of each value by itself."""

    def __init__(self, of: ValueNode, kind: Kind, change: Callable[[Values], Values]) -> None:
        self.kind, self.children, self._change = kind, (of,), change

    def values(self, rows: RowSet) -> Values:
        """Return the changed values."""
        return self._change(self.children[0].values(rows))


class PairNode(ValueNode):
    """The result of a function of two values of a row; it returns what there is, and which are something."""

    def __init__(
        self, left: ValueNode, right: ValueNode, kind: Kind, make: Callable[[Array, Array], tuple[Array, Array | None]]
    ) -> None:
        self.kind, self.children, self._make = kind, (left, right), make

    def values(self, rows: RowSet) -> Values:
        """Return what comes out."""
        left, right = _sides(self.children[0], self.children[1], rows)
        with np.errstate(all="ignore"):  # what comes of infinite values is not worth a warning
            made, good = self._make(_plain(left), _plain(right))
        base = left if isinstance(left, Values) else right
        assert isinstance(base, Values)  # noqa: S101 - two constants are one
        found = base
        if isinstance(left, Values) and isinstance(right, Values) and right.has is not None:
            found = found.with_data(found.data, right.has)
        return found.with_data(made, good)._replace(place=None, length=None)


class RowNode(ValueNode):
    """One value a row, of all values of some expressions: the most, the least, how many there are."""

    def __init__(self, what: str, of: tuple[ValueNode, ...], kind: Kind) -> None:
        self.kind, self.children, self._what = kind, of, what

    def values(self, rows: RowSet) -> Values:
        """Return it."""
        every = [child.values(rows) for child in self.children]
        counts = np.zeros(rows.size, np.int64)
        for one in every:
            counts += np.bincount(one.rows()[one.there()], minlength=rows.size)
        if self._what == "count":
            return Values(None, counts, counts > 0)
        plain = [signed(one.plain) for one in every]
        real = any(one.dtype.kind == "f" for one in plain)
        ufunc, start = (np.maximum, -np.inf) if self._what == "max" else (np.minimum, np.inf)
        kind = np.dtype(np.float64 if real else np.int64)
        limit = start if real else np.iinfo(np.int64).min if self._what == "max" else np.iinfo(np.int64).max
        found = np.full(rows.size, limit, kind)
        for one, numbers in zip(every, plain, strict=True):
            there = one.there()
            with np.errstate(invalid="ignore"):  # a value that is none
                ufunc.at(found, one.rows()[there], numbers[there].astype(kind))
        return Values(None, found, counts > 0)


class Condition(ABC):
    """Something that holds for rows or not; `cost` says what to ask first."""

    cost: int = 0
    parts: tuple[Condition, ...] = ()
    operands: tuple[ValueNode, ...] = ()

    @abstractmethod
    def test(self, rows: RowSet) -> Array:
        """Return the rows that it holds for."""

    def fields(self) -> Iterator[FieldRef]:
        """Yield the fields that it asks for."""
        for part in self.parts:
            yield from part.fields()
        for operand in self.operands:
            yield from operand.fields()

    def _priced(self) -> None:
        fields = list(self.fields())
        self.cost = max(
            (TABLES if ref.tables and ref.origin == "table" else _COSTS.get(ref.origin, TABLES) for ref in fields),
            default=0,
        )


class Present(Condition):
    """A row has a value; of flags, one that is set."""

    def __init__(self, of: ValueNode, *, exists: bool = False) -> None:
        self.operands, self._exists = (of,), exists
        self._priced()

    def test(self, rows: RowSet) -> Array:
        """Return the rows."""
        kind, values = self.operands[0].kind, self.operands[0].values(rows)
        good = np.ones(values.amount, bool)
        if not self._exists and kind.sort == "flag":
            good = values.plain.astype(bool)
        elif not self._exists and kind.mask and kind.sort == "number":
            good = values.plain.astype(np.int64) & kind.mask != 0
        return any_row(values, good, rows.size)


class ComparisonOf(Condition):
    """A comparison of two sides; `holds` takes their data, or a constant as it is."""

    def __init__(
        self, left: ValueNode, right: ValueNode, holds: Callable[[object, object], Array], *, every: bool
    ) -> None:
        self.operands, self._holds, self._every = (left, right), holds, every
        self._priced()

    def test(self, rows: RowSet) -> Array:
        """Return the rows."""
        left, right = _sides(self.operands[0], self.operands[1], rows)
        base = left if isinstance(left, Values) else right
        assert isinstance(base, Values)  # noqa: S101 - two constants are not compared
        if isinstance(left, Values) and isinstance(right, Values) and right.has is not None:
            base = base.with_data(base.data, right.has)
        with np.errstate(invalid="ignore", over="ignore"):
            good = self._holds(*(one.data if isinstance(one, Values) else one for one in (left, right)))
        return (every_row if self._every else any_row)(base, np.asarray(good, bool), rows.size)


class ValueTest(Condition):
    """A condition on each value by itself."""

    def __init__(self, of: ValueNode, holds: Callable[[Values], Array], *, every: bool) -> None:
        self.operands, self._holds, self._every = (of,), holds, every
        self._priced()

    def test(self, rows: RowSet) -> Array:
        """Return the rows."""
        values = self.operands[0].values(rows)
        return (every_row if self._every else any_row)(values, self._holds(values), rows.size)


class Negation(Condition):
    """The rows that something does not hold for."""

    def __init__(self, of: Condition) -> None:
        self.parts, self.cost = (of,), of.cost

    def test(self, rows: RowSet) -> Array:
        """Return the rows."""
        found: Array = ~self.parts[0].test(rows)
        return found


class Junction(Condition):
    """All of some conditions (`both`), or any of them: the cheap ones first, the others of rows in question."""

    def __init__(self, parts: tuple[Condition, ...], *, both: bool) -> None:
        self.parts, self.both = parts, both
        self._order = sorted(parts, key=lambda part: part.cost)
        self.cost = max(part.cost for part in parts)

    def test(self, rows: RowSet) -> Array:
        """Return the rows."""
        outer = rows.wanted
        open_ = np.ones(rows.size, bool) if outer is None else outer.copy()
        found = np.full(rows.size, self.both)
        try:
            for part in self._order:
                if part.cost >= TABLES:
                    if not open_.any():
                        break
                    rows.wanted = open_
                holds = part.test(rows)
                if self.both:
                    found &= holds
                    open_ &= holds
                else:
                    found |= holds
                    open_ &= ~holds
        finally:
            rows.wanted = outer
        return found


def _sides(left: ValueNode, right: ValueNode, rows: RowSet) -> tuple[Values | object, Values | object]:
    if isinstance(left, ConstantNode):
        return left.value, right.values(rows)
    if isinstance(right, ConstantNode):
        return left.values(rows), right.value
    return joined(left.values(rows), right.values(rows), rows.size)


def _plain(side: Values | object) -> Array:
    return side.plain if isinstance(side, Values) else side  # type: ignore[return-value]


class MomentTest(Condition):
    """A condition on times; `holds` takes them and what the moments are in this capture."""

    def __init__(
        self, of: ValueNode, moments: Sequence[Moment], holds: Callable[[Array, list[int]], Array], *, every: bool
    ) -> None:
        self.operands, self._moments, self._holds, self._every = (of,), moments, holds, every
        self._priced()

    def test(self, rows: RowSet) -> Array:
        """Return the rows; none of a capture whose times have no date."""
        zero = rows.context.memory.zero
        values = self.operands[0].values(rows)
        if zero is None or not all(moment.fits(zero) for moment in self._moments):
            return np.zeros(rows.size, bool)
        good = self._holds(values.plain, [moment.at(zero) for moment in self._moments])
        return (every_row if self._every else any_row)(values, good, rows.size)


def moment_test(of: ValueNode, moment: Moment, compare: Callable[[Array, int], Array], *, every: bool) -> Condition:
    """Return the comparison with one moment."""
    return MomentTest(of, [moment], lambda times, at: compare(times, at[0]), every=every)


def moment_set(
    of: ValueNode, singles: Sequence[Moment], ranges: Sequence[tuple[Moment, Moment]], *, every: bool
) -> Condition:
    """Return whether a time is one of some, or between two of them."""
    flat = [moment for pair in ranges for moment in pair]

    def holds(times: Array, at: list[int]) -> Array:
        found: Array = np.isin(times, at[: len(singles)])
        for low, high in zip(at[len(singles) :: 2], at[len(singles) + 1 :: 2], strict=True):
            found |= (times >= low) & (times <= high)
        return found

    return MomentTest(of, [*singles, *flat], holds, every=every)
