"""Notes of a profile: what the tables `field` and `derived` say of one layout, checked against it."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Literal, cast

from dissectors import template
from dissectors.layout import ArrayType, CompoundType, PrimitiveType
from dissectors.records import dataclass
from dissectors.schema import Agreement, Bits, Derived, Measure, Note, Piece, UnitBy

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from dissectors.layout import Type
    from dissectors.toml_table import TomlTable

Enums = dict[str, dict[int, str]]

MAX_COUNTER_BITS = 32  # a wider one does not live to wrap

_NO_NOTE = Note()


@dataclass(frozen=True, slots=True)
class NoteReader:
    """Reads the notes of messages and packets; `enums` are the profile's named enumerations.

    `messages` gives the layout of a message of the profile, None if it has none of this name. Only a reader of packets
    has it, and only packets have the keys `wraps` and `agrees`.
    """

    enums: Enums
    messages: Callable[[str], CompoundType | None] | None = None

    def notes(self, table: TomlTable, layout: CompoundType, clause: str) -> dict[str, Note]:
        """Return a note for each field that the table `field` names; "no 5" is row 5 of the table in `clause`."""
        result = {}
        for name, body in table.tables("field"):
            kind = layout.member(name)
            if kind is None:
                allowed = ", ".join(member.name for member in layout.fields if member.name)
                body.fail(f"{layout.name} has no such field (allowed: {allowed})")
            result[name] = self._note(body, kind, layout, clause)
        return result

    def derived(self, table: TomlTable, layout: CompoundType, clause: str) -> dict[str, Derived]:
        """Return the columns of the table `derived` by name, each computed from one numeric field."""
        result = {}
        for name, body in table.tables("derived"):
            source = body.string("source")
            kind = _scalar(layout.member(source))
            if kind is None or kind.kind == "bool":
                body.fail(f"{source!r} is no number of {layout.name}", "source")
            element, outer = body.integer("element"), layout.member(source)
            if element is not None and not (isinstance(outer, ArrayType) and 0 <= element < outer.max):
                body.fail(f"{source!r} has no such element", "element")
            if layout.member(name) is not None or not name.isidentifier():
                body.fail("a derived column needs a name of its own, a letter and then letters, digits or _")
            result[name] = self._derived(name, source, body, clause)
        return result

    def summary(
        self, table: TomlTable, layout: CompoundType, notes: Mapping[str, Note], derived: Mapping[str, Derived]
    ) -> str:
        """Return the table's `summary` template, every column of it checked."""
        return template_of(table, "summary", known_columns(layout, notes, derived))

    def _note(self, body: TomlTable, kind: Type, layout: CompoundType, clause: str) -> Note:
        scalar = _scalar(kind)
        clause = _clause(body, clause)
        note = Note(
            name=body.string("name"),
            unit=body.string("unit"),
            scale=body.scale("scale"),
            enum=self._enum(body, "enum", scalar),
            special=self._enum(body, "special", scalar),
            parts=self._parts(body, kind, clause),
            low=body.fraction("low"),
            high=body.fraction("high"),
            clause=clause,
            text=body.flag("text"),
            hex=body.flag("hex"),
            unit_by=self._unit_by(body, layout),
            wraps=self.messages is not None and body.flag("wraps"),
            agrees=self._agreement(body),
        )
        body.finish()
        if note.text and not (
            isinstance(kind, ArrayType) and scalar is not None and (scalar.kind, scalar.bits) == ("uint", 8)
        ):
            body.fail("only an array of uint8 can be text", "text")
        for key in ("scale", "low", "high"):
            if scalar is None and body.body.get(key) is not None:
                body.fail("only a number has this", key)
        if note.wraps and not (
            isinstance(kind, PrimitiveType) and kind.kind == "uint" and kind.bits <= MAX_COUNTER_BITS
        ):
            body.fail(f"only a single unsigned number of at most {MAX_COUNTER_BITS} bits wraps", "wraps")
        if note.agrees is not None and not (isinstance(kind, PrimitiveType) and kind.bits > 8 and kind.bits % 8 == 0):
            body.fail("only a single number of two or more whole bytes has a byte order", "agrees")
        _ordered(body)
        return note

    def _agreement(self, body: TomlTable) -> Agreement | None:
        """Read `agrees = { with = "ESCStatus.voltage", within = 0.02 }`: a message's number, and a share of it."""
        if self.messages is None:
            return None
        outer = body.table("agrees")
        if "agrees" not in body.body:
            return None
        path, within = outer.string("with"), outer.fraction("within")
        outer.finish()
        message, _, field = path.rpartition(".")
        layout = self.messages(message)
        if layout is None:
            outer.fail(f"{message!r} is no message of this profile", "with")
        kind = layout.member(field)
        if not isinstance(kind, PrimitiveType) or kind.kind in ("bool", "void"):
            outer.fail(f"{field!r} is no number of {layout.name}", "with")
        if within is None or not 0 <= within < 1:
            outer.fail("a share from 0 to below 1 is expected", "within")
        return Agreement(message, field, within)

    def _enum(self, body: TomlTable, key: str, scalar: PrimitiveType | None) -> dict[int, str]:
        """Return raw values with texts: the name of an enumeration of the profile, or a table of its own."""
        if isinstance(body.body.get(key), str):
            name = body.one_of(key, self.enums)
            values = self.enums[name]
        else:
            values = body.texts(key)
        if values and (scalar is None or scalar.kind == "float"):
            body.fail("only a whole number has named values", key)
        if scalar is not None and not all(_fits(value, scalar) for value in values):
            body.fail(f"a value that {scalar.bits} bits cannot hold", key)
        return values

    def _parts(self, body: TomlTable, kind: Type, clause: str) -> tuple[Bits, ...]:
        parts: list[Bits] = []
        taken: dict[int, str] = {}
        for name in body.table("bits").body:
            outer = body.table("bits")
            if not isinstance(kind, PrimitiveType) or kind.kind != "uint":
                body.fail("only a single unsigned number has bit parts", "bits")
            part = self._part(name, outer, clause)
            if part.high >= kind.bits:
                outer.fail(f"bit {part.high} is outside the field's {kind.bits} bits", name)
            if not name.isidentifier():
                outer.fail("a part's name is a letter and then letters, digits or _", name)
            for bit in range(part.low, part.high + 1):
                if bit in taken:
                    outer.fail(f"bit {bit} belongs to {taken[bit]} already", name)
                taken[bit] = name
            parts.append(part)
        return tuple(parts)

    def _part(self, name: str, outer: TomlTable, clause: str) -> Bits:
        """Read `stall = 7`, a flag, or `mode = { at = "12-15", enum = "Mode" }`, the long form."""
        if isinstance(outer.body[name], int):
            bit = outer.integer(name) or 0
            return Bits(name, bit, bit, clause=clause)
        body = outer.table(name)
        at = body.string("at")
        first, _, last = at.partition("-")
        if not (first.isdecimal() and (last or first).isdecimal() and len(at) <= 5):
            body.fail("bits are written '3' or '12-15'", "at")
        low, high = int(first), int(last or first)
        if low > high or high > 63:
            body.fail("bits go from low to high, 63 at most", "at")
        part = Bits(
            name=name,
            low=low,
            high=high,
            scale=body.scale("scale"),
            unit=body.string("unit"),
            enum=self._enum(body, "enum", PrimitiveType("uint", high - low + 1)),
            clause=body.string("clause") or clause,
            tentative=body.flag("tentative"),
            title=body.string("title"),
            low_limit=body.fraction("low"),
            high_limit=body.fraction("high"),
        )
        body.finish()
        _ordered(body)
        return part

    def _unit_by(self, body: TomlTable, layout: CompoundType) -> UnitBy | None:
        """Read `unit_by.<field>`: for each raw value of that field how this one is read."""
        tables = list(body.tables("unit_by"))
        if not tables:
            return None
        if len(tables) > 1:
            body.fail("the unit can follow one field only", "unit_by")
        name, outer = tables[0]
        kind = layout.member(name)
        if not isinstance(kind, PrimitiveType) or kind.kind != "uint":
            outer.fail(f"{layout.name} has no unsigned field of this name")
        measures = {}
        for key in outer.body:
            row = outer.table(key)
            value = outer.number(key)
            if not _fits(value, kind):
                outer.fail(f"{value} does not fit in {kind.bits} bits", key)
            measures[value] = Measure(
                row.scale("scale"), row.string("unit"), row.string("meaning"), row.fraction("high")
            )
            row.finish()
        return UnitBy(name, measures)

    def _derived(self, name: str, source: str, body: TomlTable, clause: str) -> Derived:
        plain = Derived(name, source)
        derived = Derived(
            name=name,
            source=source,
            scale=body.scale("scale") or plain.scale,
            offset=body.fraction("offset") or plain.offset,
            pieces=tuple(self._pieces(body)),
            unit=body.string("unit"),
            clause=_clause(body, clause),
            format=cast('Literal["", "date"]', body.one_of("format")),
            element=body.integer("element"),
            low=body.fraction("low"),
            high=body.fraction("high"),
            reading=body.string("reading"),
            by_choice=dict(_choices(body)),
        )
        if bool(derived.reading) != bool(derived.by_choice):
            body.fail("reading and by_choice go together")
        if derived.reading and self.messages is not None:
            body.fail("only messages have readings", "reading")
        body.finish()
        _ordered(body)
        return derived

    def _pieces(self, body: TomlTable) -> Iterator[Piece]:
        for row in body.rows("pieces"):
            start, stop, add = row.fraction("start"), row.fraction("stop"), row.fraction("add")
            row.finish()
            if add is None:
                row.fail("add is missing")
            if start is not None and stop is not None and start >= stop:
                row.fail("start must be below stop")
            yield Piece(start, stop, add)


def known_columns(
    layout: CompoundType, notes: Mapping[str, Note], derived: Mapping[str, Derived]
) -> dict[str, int | float | str]:
    """Return every column of a layout with a sample value, the computed ones too."""
    known: dict[str, int | float | str] = dict(columns(layout, notes))
    return known | {name: "text" if column.format else 1.5 for name, column in derived.items()}


def template_of(table: TomlTable, key: str, known: Mapping[str, int | float | str]) -> str:
    """Return a template, every column of it checked against those that are known."""
    text = table.string(key)
    try:
        slots = template.parse(text)
    except ValueError as error:
        table.fail(str(error), key)
    for slot in slots:
        if slot.column and slot.column not in known:
            table.fail(f"no column {slot.column!r} (allowed: {', '.join(sorted(known))})", key)
        if slot.column and not slot.fits(known[slot.column]):
            table.fail(f"the format {slot.format!r} does not suit {slot.column}", key)
    return text


def columns(
    layout: CompoundType, notes: Mapping[str, Note], prefix: str = ""
) -> Iterator[tuple[str, int | float | str]]:
    """Yield the columns of a layout with a sample value: fields, their parts, `field.member` of nested structures."""
    for member in layout.fields:
        if not member.name:
            continue
        path = f"{prefix}{member.name}"
        note = notes.get(path, _NO_NOTE)
        yield path, _sample(member.type, note)
        for part in note.parts:
            yield f"{path}.{part.name}", "text" if part.enum else 1 if part.scale is None else 1.5
        if note.wraps:
            yield f"{path}.unwrapped", 1 if note.scale is None else 1.5
        inner = member.type.element if isinstance(member.type, ArrayType) else member.type
        if isinstance(inner, CompoundType):
            yield from columns(inner, notes, f"{path}.")


def _sample(kind: Type, note: Note) -> int | float | str:
    scalar = _scalar(kind)
    if scalar is None or note.enum or note.text:
        return "text"
    return 1.5 if scalar.kind == "float" or note.scale is not None else 1


def _scalar(kind: Type | None) -> PrimitiveType | None:
    """Return the number that a field, or each element of it, is."""
    inner = kind.element if isinstance(kind, ArrayType) else kind
    return inner if isinstance(inner, PrimitiveType) else None


def _clause(body: TomlTable, table: str) -> str:
    own = body.string("clause")
    return f"{table} {own}" if own.startswith("no ") else own


def _fits(value: int, kind: PrimitiveType) -> bool:
    if kind.kind == "int":
        return -(1 << kind.bits - 1) <= value < 1 << kind.bits - 1
    return 0 <= value < 1 << kind.bits


def _ordered(body: TomlTable) -> None:
    low, high = body.fraction("low"), body.fraction("high")
    if low is not None and high is not None and low > high:
        body.fail("low is above high", "low")


def _choices(body: TomlTable) -> Iterator[tuple[str, Fraction]]:
    """Yield what choices of a reading add."""
    table = body.table("by_choice")
    for choice in table.body:
        yield choice, table.fraction(choice) or Fraction(0)
