"""The fields of a row as a tree of lines: templates of value, unit, name, raw number, bit parts, and where they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pyarrow as pa

from analyzer.decode.readings import UNDECIDED
from analyzer.decode.told import reading_column
from analyzer.facts.meaning import Meaning, meaning
from analyzer.views.members import NOTHING, PLAIN, unscaled, whole
from analyzer.views.terminal import escape
from analyzer.views.values import unless_special
from analyzer.views.wording import MISSING, UNSPECIFIED
from dissectors.records import dataclass
from dissectors.schema import ArrayType, CompoundType, Message, PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.views.members import Take
    from analyzer.views.sheets import SheetColumns, Template
    from dissectors.schema import Bits, Derived, Packet, Reading, Type

STEP = " " * 4
_ABOUT = 60  # characters in front of where a value is
_SHOWN = 24  # elements of a list of numbers in one line; bytes come in full
_WHERE: Template = ("where", "byte ", "bytes ", " bit ", " bits ", " to byte ")
_NUMBER: Template = ("number", PLAIN, ("plain",))


def text(words: str) -> Template:
    """Return a template of a text."""
    return ("text", words)


def line(*pieces: Template, where: Template = NOTHING) -> Template:
    """Return a template of a line, and behind it what it is about."""
    return ("line", _ABOUT, ("all", list(pieces)), where)


@dataclass(frozen=True, slots=True)
class Branches:
    """Grows a branch for every field, then for every derived value.

    Args:
        of: layout and meaning.
        columns: of its table.
        payload: the place of the payload among the columns of transfers.
        indent: what stands in front of each line.
    """

    of: Message | Packet
    columns: SheetColumns
    payload: int
    indent: str

    def templates(self) -> list[Template]:
        """Return templates of the lines about a row, which is a row of the table."""
        return [self._fields(None), *map(self._derived, self.of.derived)]

    def inside(self, name: str, template: Template) -> Template:
        """Return a template in the cell of a field, and in its bits."""
        return self._fields((name, self.columns.of(self.columns.own(name), template)))

    def _fields(self, only: tuple[str, Template] | None) -> Template:
        """Return a template of all fields, or of one of them only, which is given."""
        code = self.columns.place("layout") if isinstance(self.of, Message) else None
        layout = self.of.layout
        places = [self.columns.place(self.columns.own(m.name)) if m.name else None for m in layout.fields]
        made = []
        for member, place in zip(layout.fields, places, strict=True):
            kind = None if place is None else self.columns.schema.field(self.columns.own(member.name)).type
            node = None
            if kind is not None and only is None:
                node = self._field(member.type, kind, member.name, place or 0, self.indent)
            elif only is not None and only[0] == member.name:
                node = only[1]
            made.append((place, _layout(member.type, kind), node))
        if not layout.union or only is not None:
            return ("union", layout.tag_bits, made) if layout.union else ("fields", code, made)
        one = [
            ("union", layout.tag_bits, [(at, bits, node if at == place else None) for at, bits, node in made])
            for place in places
        ]
        return (
            "all",
            [("given", place, found, node) for place, found, (_, _, node) in zip(places, one, made, strict=True)],
        )

    def _field(self, kind: Type, column: pa.DataType, name: str, place: int, pad: str) -> Template:
        """Return a template in the structure that has a field at a place; a doubtful one may mean something else."""
        about = meaning(self.of, name)
        doubt = self._doubt(name)
        if doubt is None or not doubt.noted:
            return self._branch(kind, column, name, place, pad, about)
        known = self._branch(kind, column, name, place, pad, about)
        other = self._branch(kind, column, name, place, pad, Meaning(clause=about.clause))
        return ("like", self.columns.place(reading_column(doubt.name)), doubt.noted, known, other)

    def _doubt(self, name: str) -> Reading | None:
        readings = self.of.readings if isinstance(self.of, Message) else ()
        return next((one for one in readings if one.field == name), None)

    def _branch(self, kind: Type, column: pa.DataType, name: str, place: int, pad: str, about: Meaning) -> Template:
        label = name.rpartition(".")[2]
        if about.note is not None and about.note.name:
            label = f"{about.note.name} ({label})"
        return self._labelled(kind, column, name, place, pad, about, text(label))

    def _labelled(
        self, kind: Type, column: pa.DataType, name: str, place: int | None, pad: str, about: Meaning, label: Template
    ) -> Template:
        """Return a template in the structure; without a place in the cell itself, as elements of lists are."""
        clause = text(f"clause {about.clause}" if about.clause else "")
        where: Template = ("joined", "  ", [_WHERE, clause])
        head = [text(pad), label]

        def cell(template: Template) -> Template:
            return template if place is None else ("of", place, template)

        if isinstance(kind, CompoundType):
            some = self._members(kind, column, name, pad + STEP)
            titles = line(*head, where=where), line(*head, text(": empty"), where=where)
            found = cell(("all", [_titled(kind, *titles), some]))
        elif isinstance(kind, ArrayType) and isinstance(kind.element, CompoundType):
            index: Template = ("all", [label, text("["), ("index",), text("]")])
            element = self._labelled(kind.element, column.value_type, name, None, pad + STEP, about, index)
            title = line(*head, text(": "), cell(("count",)), text(" elements"), where=where)
            found = ("all", [title, cell(("elements", _layout(kind, column), element))])
        elif isinstance(kind, ArrayType):
            found = line(*head, text(": "), cell(_list(kind, about)), where=where)
        else:
            value, below = self._scalar(kind, column, name, cell, about)
            said = line(*head, text(": "), value, where=where)
            found = ("all", [said, *[line(text(pad + STEP), one) for one in self._said(name)], cell(below(pad + STEP))])
        gone = line(*head, text(": missing"), where=where)
        return ("given", place, found, gone) if place is not None else ("instead", gone, ("or", "", found))

    def _members(self, kind: CompoundType, column: pa.DataType, name: str, pad: str) -> Template:
        made = []
        for member in kind.fields:
            at = column.get_field_index(member.name) if member.name else None
            inner = None if at is None else column.field(at).type
            node = None
            if at is not None and inner is not None:
                node = self._field(member.type, inner, f"{name}.{member.name}", at, pad)
            made.append((at, _layout(member.type, inner), node))
        return ("union", kind.tag_bits, made) if kind.union else ("fields", None, made)

    def _said(self, name: str) -> list[Template]:
        """Say how a doubtful field is read; what is not decided is the choice without evidence, or none."""
        doubt = self._doubt(name)
        if doubt is None:
            return []
        choice = self.columns.place(reading_column(doubt.name))
        so_far: Template = ("by", self.columns.place("decided"), [(1, NOTHING)], text(" so far"))
        if doubt.otherwise:
            so_far = ("like", choice, doubt.otherwise, so_far, NOTHING)
        read: Template = ("all", [text("[read as "), ("of", choice, ("copy",)), so_far, text("]")])
        return [("given", choice, read, text(f"[{UNDECIDED}: {' or '.join(doubt.choices)}]"))]

    def _scalar(
        self, kind: PrimitiveType, column: pa.DataType, name: str, cell: Callable[[Template], Template], about: Meaning
    ) -> tuple[Template, Callable[[str], Template]]:
        """Return the template of a single value, and of its bit parts, the latter in the cell."""
        note, raw = about.note, self._raw(kind, column, about)
        unit = _unit(about.unit)
        shown = _shown(about)
        if raw is not None and not _always(kind, about):  # where a value has a name
            shown, raw = _shown(about, raw), None
        found = cell(("all", [shown, text(unit)]))
        if note is not None and note.unit_by is not None and f"{name}.value" in self.columns:
            value, by = self.columns.place(f"{name}.value"), self.columns.place(f"{name}.unit")
            told: Template = ("of", by, ("unlike", UNSPECIFIED, ("headed", "", " ", ("copy",))))
            found = ("given", value, ("all", [("of", value, _NUMBER), told]), found)
        word = unscaled(kind, note)

        def below(pad: str) -> Template:
            parts = [_part(part, word, kind.bits, pad) for part in (note.parts if note is not None else ())]
            if not parts or note is None:
                return NOTHING
            return ("held", self.payload, ("switch", word, [(one, NOTHING) for one in note.special], ("all", parts)))

        return ("all", [found, *([raw] if raw is not None else [])]), below

    def _raw(self, kind: PrimitiveType, column: pa.DataType, about: Meaning) -> Template | None:
        """Return the template of the raw number, if it says more than the value does."""
        if kind.kind == "float":
            return ("raw", self.payload, kind.bits // 4, False, " (raw 0x", ")")
        if about.note is not None and about.note.hex:
            return ("raw", self.payload, -(-kind.bits // 4), False, " (0x", ")")
        if pa.types.is_floating(column):
            return ("raw", self.payload, None, kind.kind == "int", " (raw ", ")")
        return None

    def _derived(self, derived: Derived) -> Template:
        """Return the template of a computed value, or of what stands for it."""
        columns, unit = self.columns, _unit(derived.unit)
        kind = columns.schema.field(columns.own(derived.name)).type
        shown: Template = ("copy",) if pa.types.is_string(kind) else _NUMBER
        if pa.types.is_list(kind):
            shown = ("each", " ", _SHOWN, "", ("or", MISSING, _NUMBER))
        if unit and pa.types.is_list(kind):  # which one missing number does not have
            measured: Template = ("instead", ("first", unit, ("or", "", text(unit))), ("beyond", 1, text(unit)))
        else:
            measured = text(unit)
        value = columns.of(columns.own(derived.name), ("or", MISSING, ("all", [shown, measured])))
        source = self.of.notes.get(derived.source)
        if source is not None:
            value = unless_special(self.of, columns, derived.source, source, value)
        clause = text(f"clause {derived.clause}" if derived.clause else "")
        return line(text(f"{self.indent}[{derived.name}: "), value, text(f", from {derived.source}]"), where=clause)


def _titled(kind: CompoundType, title: Template, empty: Template) -> Template:
    """Return a template in a structure: its title, another one if nothing stands below it."""
    names = [member.name for member in kind.fields if member.name]
    if not kind.union:
        return title if names else empty
    for place in reversed(range(len(names))):
        empty = ("given", place, title, empty)
    return empty


def _layout(kind: Type, column: pa.DataType | None) -> Template:
    """Return how a type lies in a payload, with the places of the members of structures in their column."""
    if isinstance(kind, PrimitiveType):
        return ("bits", kind.bits)
    if isinstance(kind, ArrayType):
        element = _layout(kind.element, None if column is None else column.value_type)
        return ("list", element, None if kind.dynamic else kind.max, kind.length_bits, kind.element.min_bits)
    members = []
    for member in kind.fields:
        at = column.get_field_index(member.name) if column is not None and member.name else None
        inner = None if at is None or column is None else column.field(at).type
        members.append((at, _layout(member.type, inner)))
    return ("union", kind.tag_bits, members) if kind.union else ("struct", members)


def _part(part: Bits, word: Take, width: int, pad: str) -> Template:
    bits = (word[0], (part.low, part.width), None, False)
    value: Template = ("number", bits, ("plain",))
    if part.flag:
        value = ("switch", bits, [(1, text("set"))], text("not set"))
    elif part.scale is not None:
        scale = float(part.scale.numerator), float(part.scale.denominator)
        scaled: Template = ("number", (*bits[:2], scale, False), ("plain",))
        value = ("all", [scaled, text(f"{_unit(part.unit)} (raw "), value, text(")")])
    elif part.enum:
        names = [(one, text(f" ({escape(name)})")) for one, name in part.enum.items()]
        value = ("all", [value, ("switch", bits, names, text(" (undefined)"))])
    guess = text(" (tentative name)" if part.tentative else "")
    picture: Template = ("bits", word, width, part.low, part.high)
    return line(text(pad), picture, text(f" = {part.name}: "), value, guess)


def _always(kind: PrimitiveType, about: Meaning) -> bool:
    """Return whether the raw number stands behind every value."""
    note = about.note
    told = note is not None and (note.hex or bool(note.enum) or note.unit_by is not None)
    return kind.kind == "float" or told or bool(_unit(about.unit))


def _shown(about: Meaning, behind: Template = NOTHING) -> Template:
    """Return the template of a number, with its name if it has one."""
    unnamed = " (undefined)" if about.note is not None and about.note.enum else ""
    otherwise: Template = ("all", [_NUMBER, text(unnamed)]) if unnamed else _NUMBER
    if not about.texts:
        return otherwise
    cases = [
        (whole(value), ("all", [_NUMBER, text(f" ({escape(name)})"), behind])) for value, name in about.texts.items()
    ]
    return ("switch", PLAIN, cases, otherwise)


def _list(kind: ArrayType, about: Meaning) -> Template:
    """Return the template of numbers in one line; bytes in hexadecimal and, if they are characters, as such."""
    if isinstance(kind.element, PrimitiveType) and (kind.element.kind, kind.element.bits) == ("uint", 8):
        return ("octets", "empty", ' "', '"')
    some: Template = ("all", [("each", " ", _SHOWN, "", ("or", MISSING, _shown(about))), text(_unit(about.unit))])
    first: Template = ("first", "empty", NOTHING)
    more: Template = ("beyond", _SHOWN, ("all", [text(" ... "), ("count",), text(" in all")]))
    return ("all", [first, ("beyond", 0, some), more])


def _unit(unit: str) -> str:
    return f" {unit}" if unit not in ("", UNSPECIFIED) else ""
