"""The fields of one row as a tree of texts: value, unit, name, raw number, bit parts, and the bytes they came from."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from analyzer.decode.readings import UNDECIDED
from analyzer.decode.told import reading_column
from analyzer.facts.meaning import Meaning, meaning, stands_for
from analyzer.views.places import FieldPlace, raw_bits, span
from analyzer.views.terminal import escape
from analyzer.views.wording import plain, quantity
from dissectors.schema import ArrayType, CompoundType, Message, PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dissectors.schema import Bits, Derived, Packet, Reading, Type

    Lookup = Callable[[str], Any]

_SHOWN = 24  # elements of a list of numbers in one line; bytes come in full


@dataclass(frozen=True, slots=True)
class Branch:
    """A line, the bytes it is about, and what is below it."""

    text: str
    where: str = ""
    below: Sequence[Branch] = field(default_factory=tuple)


def branches(of: Message | Packet, value: Lookup, where: Sequence[FieldPlace], payload: bytes) -> list[Branch]:
    """Grow a branch for every field, then for every derived value.

    Args:
        of: layout and meaning.
        value: gives the row's cell of a column.
        where: the places of all values in `payload`.
        payload: the bytes that `where` counts in.
    """
    grow = _Grower(of, value, list(where), payload)
    fields = [grow.branch(m.type, m.name, m.name, value(m.name)) for m in of.layout.fields if m.name]
    derived = [
        Branch(f"[{d.name}: {_computed(of, d, value)}, from {d.source}]", f"clause {d.clause}" if d.clause else "")
        for d in of.derived
    ]  # fmt: skip
    return [*fields, *derived]


def word_bits(word: int, width: int, low: int, high: int) -> str:
    """Write bits `low` to `high` of a word as digits, the others as points, in groups of four from the right."""
    return _digits(word & (1 << high + 1) - (1 << low), width, low, high)


@lru_cache(maxsize=4096)
def _digits(word: int, width: int, low: int, high: int) -> str:
    """Write what `word_bits` does; the bits that are not asked for are 0, so that rows share a text."""
    digits = [str(word >> bit & 1) if low <= bit <= high else "." for bit in range(width)]
    groups = ["".join(reversed(digits[k : k + 4])) for k in range(0, width, 4)]
    return " ".join(reversed(groups))


class _Grower:
    def __init__(self, of: Message | Packet, value: Lookup, where: list[FieldPlace], payload: bytes) -> None:
        self.of = of
        self.value = value
        self.where = where
        self.payload = payload
        readings = of.readings if isinstance(of, Message) else ()
        self.read = {reading.field: (reading, value(reading_column(reading.name))) for reading in readings}

    def branch(self, kind: Type, name: str, path: str, cell: Any) -> Branch:
        """Grow a branch; `name` is dotted, without indexes, as the profile knows the field, `path` has them."""
        about = meaning(self.of, name)
        if name in self.read:
            reading, choice = self.read[name]
            if reading.noted not in ("", choice):
                about = Meaning(clause=about.clause)
        place = span(self.where, path)
        clause = f"clause {about.clause}" if about.clause else ""
        where = "  ".join(filter(None, [place.words() if place is not None else "", clause]))
        label = f"{path.rpartition('.')[2]}"
        if about.note is not None and about.note.name:
            label = f"{about.note.name} ({label})"
        if cell is None:
            return Branch(f"{label}: missing", where)
        if isinstance(kind, CompoundType):
            members = [m for m in kind.fields if m.name and (not kind.union or cell.get(m.name) is not None)]
            below = [self.branch(m.type, f"{name}.{m.name}", f"{path}.{m.name}", cell.get(m.name)) for m in members]
            return Branch(label if below else f"{label}: empty", where, below)
        if isinstance(kind, ArrayType) and isinstance(kind.element, CompoundType):
            below = [self.branch(kind.element, name, f"{path}[{k}]", inner) for k, inner in enumerate(cell)]
            return Branch(f"{label}: {len(cell)} elements", where, below)
        if isinstance(kind, ArrayType):
            return Branch(f"{label}: {_list(kind, cell, about)}", where)
        text, below = self._scalar(name, cell, place, about)
        if name in self.read:
            below = [Branch(f"[{self._said(*self.read[name])}]"), *below]
        return Branch(f"{label}: {text}", where, below)

    def _said(self, reading: Reading, choice: str | None) -> str:
        """Return how a doubtful field is read; what is not decided is the choice without evidence, or none."""
        if choice is None:
            return f"{UNDECIDED}: {' or '.join(reading.choices)}"
        return f"read as {choice}" + (" so far" if choice == reading.otherwise and not self.value("decided") else "")

    def _scalar(self, name: str, cell: Any, place: FieldPlace | None, about: Meaning) -> tuple[str, list[Branch]]:
        """Return the text of a single value, and its bit parts."""
        raw = raw_bits(self.payload, place) if place is not None else None
        text = quantity(_shown(cell, about), about.unit)
        note = about.note
        if note is not None and note.unit_by is not None:
            value, unit = self.value(f"{name}.value"), self.value(f"{name}.unit")
            text = text if value is None else quantity(plain(value), unit or "")
        if place is not None and place.type is not None and raw is not None:
            text += _raw(raw, place.type, cell, hexadecimal=note is not None and note.hex, scaled=text != plain(cell))
        parts = note.parts if note is not None and raw is not None and raw not in note.special else ()
        below = [_part(part, raw or 0, place.bits if place is not None else 0) for part in parts]
        return text, below


def _part(part: Bits, word: int, width: int) -> Branch:
    value = word >> part.low & (1 << part.width) - 1
    if part.flag:
        text = "set" if value else "not set"
    elif part.scale is not None:
        text = quantity(plain(float(value * part.scale)), part.unit) + f" (raw {value})"
    else:
        text = f"{value}" + (f" ({part.enum.get(value, 'undefined')})" if part.enum else "")
    guess = " (tentative name)" if part.tentative else ""
    return Branch(f"{word_bits(word, width, part.low, part.high)} = {part.name}: {text}{guess}")


def _computed(of: Message | Packet, derived: Derived, value: Lookup) -> str:
    """Return a computed value, or what stands for it."""
    instead = stands_for(of.notes.get(derived.source), value(derived.source))
    return escape(instead) or quantity(_shown(value(derived.name), meaning(of, derived.name)), derived.unit)


def _list(kind: ArrayType, cell: list[Any], about: Meaning) -> str:
    """Write numbers in one line, bytes in hexadecimal and, if they are characters, as such."""
    if isinstance(kind.element, PrimitiveType) and (kind.element.kind, kind.element.bits) == ("uint", 8):
        raw = bytes(cell)
        text = raw.partition(b"\0")[0]
        said = f' "{escape(text)}"' if text and all(0x20 <= b < 0x7F for b in text) else ""
        return f"{raw.hex(' ').upper() or 'empty'}{said}"
    texts = [_shown(inner, about) for inner in cell[:_SHOWN]]
    more = f" ... {len(cell)} in all" if len(cell) > _SHOWN else ""
    return quantity(" ".join(texts) or "empty", about.unit if texts else "") + more


def _shown(cell: Any, about: Meaning) -> str:
    if isinstance(cell, list):
        return " ".join(_shown(inner, about) for inner in cell[:_SHOWN])
    if cell in about.texts:
        return f"{plain(cell)} ({about.texts[cell]})"
    named = about.note is not None and about.note.enum
    return f"{plain(cell)} (undefined)" if named else plain(cell)


def _raw(raw: int, kind: PrimitiveType, cell: Any, *, hexadecimal: bool, scaled: bool) -> str:
    """Return the raw number where it says more than the value does."""
    if kind.kind == "float":
        return f" (raw 0x{raw:0{kind.bits // 4}X})"
    if hexadecimal:
        return f" (0x{raw:0{-(-kind.bits // 4)}X})"
    if scaled and isinstance(cell, float):
        return f" (raw {raw - (1 << kind.bits) if kind.kind == 'int' and raw >> kind.bits - 1 else raw})"
    return ""
