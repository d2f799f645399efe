"""Checks of single fields, made from the `tests` of pages.

A test reads `{ kind = "range", fields = ["ParamGet.esc_timing"] }`. Kinds:

* `range`: outside `low` to `high` of the test, else of the field's note;
* `enum`: a code that the note does not name;
* `zero`: a reserved field that is not 0;
* `backwards`: lower than before in the same node and, with `per`, the same value of another field.

Limits are raw values. What the note calls `special` is never wrong. Values for the page: `field`, `value` (raw),
`before`, `high` and `low` (the halves of a byte), and the physical number under the name that `physical` gives.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.rules.limits import outside
from dissectors.kit import Rule, usable
from dissectors.records import dataclass
from dissectors.schema import PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from fractions import Fraction

    from analyzer.rules.catalogue import Page
    from dissectors import Registry
    from dissectors.kit import Array, DecodedTable, Occurrences, Values, View, Worst
    from dissectors.toml_table import TomlTable

MOST_COUNTERS = 4096  # later ones are not followed
_GIVEN = ("field", "value", "before", "high", "low")


@dataclass(frozen=True, slots=True)
class _Field:
    """A column with its meaning; `scale` is that of the column, None where it is raw."""

    table: str
    name: str
    scale: Fraction | None
    special: tuple[int, ...]
    enum: tuple[int, ...]
    limits: tuple[Fraction | None, Fraction | None]
    shown_limits: tuple[float, float]  # of what the column shows

    @classmethod
    def of(
        cls, table: str, name: str, scale: Fraction | None, *, special: Iterable[int] = (), enum: Iterable[int] = (),
        limits: tuple[Fraction | None, Fraction | None] = (None, None),
    ) -> _Field:  # fmt: skip
        """Return a field."""
        # Half a step lies between a limit and the next raw value, whatever a scaled number was rounded to.
        low, high = (None if limit is None else float(limit) for limit in limits)
        step = 1.0 if scale is None else float(scale)
        shown = -np.inf if low is None else (low - 0.5) * step, np.inf if high is None else (high + 0.5) * step
        return cls(table, name, scale, tuple(special), tuple(enum), limits, shown)


@dataclass(frozen=True, slots=True)
class _Test:
    """One test; `per` is a column, `physical` what the page calls the physical number."""

    rule: str
    kind: str
    fields: tuple[_Field, ...]
    per: str
    physical: str
    keyed: bool
    lasting: bool


class FieldTest(Rule):
    """One test of a page."""

    def __init__(self, test: _Test) -> None:
        self.rules = (test.rule,)  # type: ignore[misc]  # every test has its own
        self._test = test
        self._before: dict[tuple[int, ...], float] = {}

    def feed(self, view: View) -> Iterable[Occurrences]:
        """Check each field with one mask."""
        for field in self._test.fields:
            table = view.table(field.table)
            if table is not None and field.name in table:
                yield from self._field(view, table, field)

    def _field(self, view: View, table: DecodedTable, field: _Field) -> Iterator[Occurrences]:
        shown = table[field.name]
        before: dict[int, float] = {}
        if self._test.kind == "backwards":
            rows = self._lower(table, field, before)
        else:
            rows = _wrong(self._test.kind, field, shown)
            rows = rows[judged(table, field.name, rows)] if len(rows) else rows
        if not len(rows):
            return
        raw = _raw(shown[rows], field)
        if field.special:
            kept = ~np.isin(raw, field.special)
            rows, raw = rows[kept], raw[kept]
        codes = dict(zip(rows.tolist(), raw.tolist(), strict=True))

        def values(row: int) -> Values:
            code = codes[row]
            said = {"field": field.name, "value": code, "high": code >> 4 & 0xF, "low": code & 0xF}
            said["before"] = before.get(row)
            if self._test.physical:
                said[self._test.physical] = shown[row].item()
            return said

        if len(rows):
            worst = self._worst(field, shown[rows], raw) if self._test.lasting else {}
            key = raw if self._test.keyed else None
            yield view.among_rows(self._test.rule, table, rows, values, key=key, worst=worst)

    def _worst(self, field: _Field, shown: Array, raw: Array) -> dict[str, tuple[Worst, Array]]:
        """Return the numbers of which the page tells the worst: what is farthest beyond a limit."""
        kind = farthest(*field.limits)
        if not self._test.physical:
            return {"value": (kind, raw.astype(np.float64))}
        kind = kind if isinstance(kind, str) or field.scale is None else kind * float(field.scale)
        return {self._test.physical: (kind, shown.astype(np.float64))}

    def _lower(self, table: DecodedTable, field: _Field, before: dict[int, float]) -> Array:
        """Return rows with a counter below the last one of its kind; notes what that was."""
        rows = judged(table, field.name, np.arange(len(table))).nonzero()[0]
        parts = [table.bus, table.src, *([table[self._test.per]] if self._test.per else [])]
        found = []
        keys = zip(*(part[rows].tolist() for part in parts), strict=True)
        for row, key, value in zip(rows.tolist(), keys, table[field.name][rows].tolist(), strict=True):
            if field.special and _raw(np.asarray(value), field).item() in field.special:
                continue
            counter = (self._test.fields.index(field), *key)
            last = self._before.get(counter)
            if last is not None and value < last:
                before[row] = last
                found.append(row)
            if last is not None or len(self._before) < MOST_COUNTERS:
                self._before[counter] = value
        return np.asarray(found, np.int64)


def rules_from(registry: Registry, pages: Mapping[str, Page]) -> Iterator[Rule]:
    """Yield a rule for each test of a page. Raises `ProfileError` for a test that cannot be made."""
    for page in pages.values():
        for table in page.tests:
            yield FieldTest(_test(registry, page, table))


def _test(registry: Registry, page: Page, table: TomlTable) -> _Test:
    kind = table.one_of("kind")
    low, high = table.fraction("low"), table.fraction("high")
    if kind != "range" and (low is not None or high is not None):
        table.fail("only a range has limits", "high" if low is None else "low")
    names = table.strings("fields")
    if not names:
        table.fail("fields is missing")
    fields = tuple(_field(registry, table, name, (low, high)) for name in names)
    per = table.string("per")
    if per and kind != "backwards":
        table.fail("only a counter that runs backwards has it", "per")
    for field in fields:
        if per:
            _field(registry, table, f"{field.table}.{per}", (None, None), "per")
        if kind == "range" and field.limits == (None, None):
            table.fail(f"{field.table}.{field.name} has no limits in its profile, and the test gives none", "fields")
        if kind == "enum" and not field.enum:
            table.fail(f"{field.table}.{field.name} has no enumeration in its profile", "fields")
    physical = table.string("physical")
    table.finish()
    unknown = {*page.values} - {*_GIVEN, physical}
    if unknown:
        table.fail(f"a test gives no value {min(unknown)!r} (but: {', '.join(_GIVEN)}, physical = NAME)")
    return _Test(page.rule, kind, fields, per, physical, bool(page.key), kind == "range" and bool(page.episode))


def _field(
    registry: Registry,
    table: TomlTable,
    path: str,
    limits: tuple[Fraction | None, Fraction | None],
    key: str = "fields",
) -> _Field:
    name = registry.table_of(path)
    of = registry.definition(name)
    if of is None:
        table.fail(f"no table of {path!r} is known", key)
    field, _, part = path.removeprefix(f"{name}.").partition(".")
    kind = of.layout.member(field)
    if not isinstance(kind, PrimitiveType) or kind.kind not in ("uint", "int"):
        table.fail(f"{name} has no whole number {field!r}", key)
    note = of.notes.get(field)
    if part:
        bits = next((one for one in note.parts if one.name == part), None) if note else None
        if bits is None or bits.flag:
            table.fail(f"{name}.{field} has no number {part!r}", key)
        own = (bits.low_limit, bits.high_limit)
        return _Field.of(name, f"{field}.{part}", bits.scale, enum=bits.enum, limits=_or(limits, own))
    if note is None:
        return _Field.of(name, field, None, limits=limits)
    own = note.low, note.high
    return _Field.of(name, field, note.scale, special=note.special, enum=note.enum, limits=_or(limits, own))


def _or(limits: tuple[Any, Any], own: tuple[Any, Any]) -> tuple[Fraction | None, Fraction | None]:
    return own if limits == (None, None) else limits


def _wrong(kind: str, field: _Field, shown: Array) -> Array:
    """Return the places of numbers that a test finds wrong."""
    if kind == "range":
        return outside(shown, *field.shown_limits)
    wrong = shown if kind == "zero" else ~np.isin(_raw(shown, field), field.enum)
    return wrong.nonzero()[0]


def _raw(shown: Array, field: _Field) -> Array:
    if field.scale is None:
        return shown.astype(np.int64)
    return np.rint(shown * field.scale.denominator / field.scale.numerator).astype(np.int64)


def farthest(low: Fraction | None, high: Fraction | None) -> Worst:
    """Return which number is worst beyond two limits."""
    if low is None or high is None:
        return "highest" if low is None else "lowest"
    return float(low + high) / 2


def judged(table: DecodedTable, column: str, rows: Array) -> Array:
    """Return which rows can be relied on: complete, with a good CRC, and as packets sound."""
    good: Array = table.once(_reliable)[rows] & table.has(column)[rows]
    return good


def _reliable(table: DecodedTable) -> Array:
    good = usable(table) if "bits_left" in table else table.trusted
    for name in ("packet_ok", "header_ok"):
        if name in table:
            good = good & table[name]
    return good
