"""Templates of decoded rows as JSON values.

Messages give what was on the wire: raw numbers by DSDL field name. Packets give physical values and text. In both a
field whose values have names, or that has bit parts, becomes an object with `raw`, and with `read_as` where the node
means something else than these names. The parts of a special value are null.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from analyzer.decode.told import reading_column
from analyzer.facts.meaning import meaning
from analyzer.views.members import ALL, NOTHING, PLAIN, CellTemplates, Take, part_of, unscaled, whole
from analyzer.views.wording import UNSPECIFIED
from dissectors.records import dataclass
from dissectors.schema import ArrayType, CompoundType, Message, PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from analyzer.views.sheets import SheetColumns, Template
    from dissectors.schema import Bits, Note, Packet, Type

NULL: Template = ("text", "null")
TEXT: Template = ("or", "null", ("json",))
HEX: Template = ("hex", "", ALL, "", "", "")


def text_of(value: Any) -> str:
    """Write JSON in ASCII: control characters and changes of writing direction are escapes."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def quotes(template: Template) -> Template:
    """Return a template of a text that has nothing to escape."""
    return ("all", [("text", '"'), template, ("text", '"')])


def number_template(take: Take = PLAIN) -> Template:
    """Return a template of a number or flag; what is not finite is a text."""
    return ("number", take, ("json", "false", "true", True))


def array_template(element: Template) -> Template:
    """Return a template of a list."""
    return ("all", [("text", "["), ("each", ",", ALL, "", element), ("text", "]")])


def member(name: str, value: Template) -> Template:
    """Return a template of a member of an object."""
    return ("all", [("text", f"{text_of(name)}:"), value])


def object_template(members: Iterable[Template]) -> Template:
    """Return a template of an object; members that write nothing are left out."""
    return ("all", [("text", "{"), ("joined", ",", list(members)), ("text", "}")])


_VALUES = CellTemplates(
    "null", lambda kind, take: ("json",) if pa.types.is_string(kind) else number_template(take), array_template
)


def structure_template(kind: pa.DataType) -> Template:
    """Return a template of a structure of a table as it is: numbers that are not finite stay numbers of Python."""
    cells = CellTemplates("null", _of_structure, array_template)
    members = [kind.field(k) for k in range(kind.num_fields)]
    return object_template(member(one.name, ("of", k, cells.cell(one.type))) for k, one in enumerate(members))


def _of_structure(kind: pa.DataType, take: Take) -> Template:
    return structure_template(kind) if pa.types.is_struct(kind) else ("number", take, ("json", "false", "true", False))


def fields_template(of: Message | Packet | None, columns: SheetColumns, *, physical: bool) -> Template:
    """Return a template of the fields of a row; `physical` scales numbers and reads texts, as packets are shown."""
    if of is None:
        data = columns.of("data", quotes(HEX))
        return object_template([member("reason", columns.of("reason", TEXT)), member("data", data)])
    fields = _Fields(of, columns, physical)
    return object_template(fields.field(one.name, one.type) for one in of.layout.fields if one.name)


def derived_templates(of: Message | Packet | None, columns: SheetColumns, *, physical: bool) -> dict[str, Template]:
    """Return templates of what follows from the fields of a row: `derived`, `units` and `texts`, each by column.

    `derived` are the computed columns, and the values in their units of fields that are raw numbers elsewhere; those of
    packets are `physical` there, too. `texts` name special values, such as "no change".
    """
    derived: dict[str, Template] = {}
    units: dict[str, Template] = {}
    texts: dict[str, Template] = {}

    def value(name: str) -> Template:
        return _VALUES.column(of, columns, name)

    for name, note in of.notes.items() if of is not None else ():
        if not physical and (note.scale is not None or note.unit_by is not None):
            derived[name] = value(f"{name}.value" if note.unit_by is not None else name)
        if note.unit_by is not None and not physical:
            units[name] = value(f"{name}.unit")
        if note.wraps:
            derived[f"{name}.unwrapped"] = value(f"{name}.unwrapped")
        known = {name: note.unit} | {f"{name}.{bits.name}": bits.unit for bits in note.parts}
        units |= _units(known | ({f"{name}.unwrapped": note.unit} if note.wraps else {}))
        if note.special:
            named = meaning(of, name).texts
            texts[name] = _named(columns, name, name, {v: t for v, t in named.items() if t in note.special.values()})
    for one in of.derived if of is not None else ():
        derived[one.name] = value(one.name)
        units |= _units({one.name: one.unit})
        source = of.notes.get(one.source) if of is not None else None
        texts[one.name] = _named(columns, one.name, one.source, source.special if source is not None else {})
    return {
        "derived": object_template(member(name, made) for name, made in derived.items()),
        "units": object_template(member(name, made) for name, made in units.items()),
        "texts": object_template(texts.values()),
    }


def _units(units: Mapping[str, str]) -> dict[str, Template]:
    return {name: ("text", text_of(unit)) for name, unit in units.items() if unit not in ("", UNSPECIFIED)}


def _named(columns: SheetColumns, name: str, column: str, texts: Mapping[Any, str]) -> Template:
    """Return a template of a member that is there only for values that have a name; lists of numbers have none."""
    if column not in columns or not texts:
        return NOTHING
    kind = columns.schema.field(columns.own(column)).type
    if pa.types.is_nested(kind) or pa.types.is_string(kind):
        return NOTHING
    cases = [(whole(value), member(name, ("text", text_of(text)))) for value, text in texts.items()]
    return columns.of(columns.own(column), ("switch", PLAIN, cases, NOTHING))


@dataclass(frozen=True, slots=True)
class _Fields:
    of: Message | Packet
    columns: SheetColumns
    physical: bool

    def field(self, name: str, kind: Type) -> Template:
        """Return a template of a member of the row; the members of a union that were not sent write nothing."""
        own = self.columns.own(name)
        made = member(name, self._value(name, own, kind))
        return ("given", self.columns.place(own), made, NOTHING) if self.of.layout.union else made

    def _value(self, name: str, own: str, kind: Type) -> Template:
        note = self.of.notes.get(name)
        if note is not None and self.physical and note.text:
            return self.columns.of(f"{name}.text", TEXT)
        raw = unscaled(kind, note)
        if note is not None and self.physical and note.unit_by is not None:
            parts = [member("raw", self.columns.of(own, number_template(raw)))]
            parts += [member(k, _VALUES.column(self.of, self.columns, f"{name}.{k}")) for k in ("value", "unit")]
            return ("given", self.columns.place(own), object_template(parts), NULL)
        members = self._members(kind, name, raw)
        doubts = list(self._doubts(name)) if members is not None else []
        if members is None or not doubts:
            return self.columns.of(own, self._cell(kind, name, raw, PLAIN if self.physical else raw))
        inside = object_template([self.columns.of(own, ("joined", ",", members)), *doubts])
        return ("given", self.columns.place(own), inside, NULL)

    def _doubts(self, name: str) -> Iterable[Template]:
        """Say of a doubtful field where its node does not mean what the names say."""
        for reading in self.of.readings if isinstance(self.of, Message) else ():
            if reading.field == name and reading.noted:
                yield self.columns.of(reading_column(reading.name), ("unlike", reading.noted, member("read_as", TEXT)))

    def _cell(self, kind: Type, name: str, raw: Take, shown: Take) -> Template:
        """Return a template of a cell; `raw` and `shown` differ only if a field is scaled: what is nested never is."""
        members = self._members(kind, name, raw)
        if members is not None:
            return ("or", "null", object_template(members))
        if not isinstance(kind, ArrayType):
            return ("or", "null", number_template(shown))  # a special value stays a number: no key changes its type
        note = self._note(name)
        named = note is not None and bool(note.enum or note.scale is not None)
        numbers = isinstance(kind.element, PrimitiveType) and kind.element.kind != "float" and not named
        element = number_template(shown) if numbers else self._cell(kind.element, name, raw, shown)
        return ("or", "null", array_template(("or", "null", element)))

    def _note(self, name: str) -> Note | None:
        """Return what is known of a field; nested types stay exactly as DSDL has them."""
        return None if "." in name else meaning(self.of, name).note

    def _members(self, kind: Type, name: str, raw: Take) -> list[Template] | None:
        """Return templates of the members of a cell that is an object, `None` for what is none."""
        if isinstance(kind, CompoundType):
            inner = [one for one in kind.fields if one.name]
            made = [self._member(k, f"{name}.{one.name}", one.type) for k, one in enumerate(inner)]
            return [("given", k, one, NOTHING) for k, one in enumerate(made)] if kind.union else made
        note = self._note(name)
        if isinstance(kind, ArrayType) or note is None or not (note.parts or note.enum):
            return None
        return list(_parts(note, raw))

    def _member(self, place: int, path: str, kind: Type) -> Template:
        note = self.of.notes.get(path)
        take = unscaled(kind, note)
        return member(path.rpartition(".")[2], ("of", place, self._cell(kind, path, take, take)))


def _parts(note: Note, word: Take) -> Iterable[Template]:
    """Give `raw`, then the bit parts, then `text`; a name is null when the value has none."""
    yield member("raw", number_template(word))
    for bits in note.parts:
        yield member(bits.name, ("switch", word, [(value, NULL) for value in note.special], _part(bits, word)))
    cases = {value: text_of(text) for value, text in {**note.enum, **note.special}.items()}
    if note.enum:
        yield member("text", ("switch", word, [(value, ("text", text)) for value, text in cases.items()], NULL))
    elif cases:
        named = [(value, member("text", ("text", text))) for value, text in cases.items()]
        yield ("switch", word, named, NOTHING)


def _part(bits: Bits, word: Take) -> Template:
    take = part_of(bits, word)
    if not bits.enum:
        return number_template(take)
    names = [(value, ("text", text_of(text))) for value, text in bits.enum.items()]
    return object_template([member("raw", number_template(take)), member("text", ("switch", take, names, NULL))])
