"""The meaning of a column: its unit and the names of its values, looked up by the column's dotted name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dissectors.schema import Bits, Message, Note, Packet


@dataclass(frozen=True, slots=True)
class Meaning:
    """Of one column. `texts` name values of its cells, `note` belongs to a field and `part` to a bit part of one.

    `source` is the field that a derived column is computed from.
    """

    unit: str = ""
    texts: Mapping[float, str] = field(default_factory=dict)
    clause: str = ""
    note: Note | None = None
    part: Bits | None = None
    source: str = ""


_MOST_KNOWN = 1 << 12
_NOTHING = Meaning()
_known: dict[tuple[int, str], tuple[Message | Packet, Meaning]] = {}  # with what it is of, whose number stays its own


def meaning(of: Message | Packet | None, column: str) -> Meaning:
    """Return the meaning of `field`, `field.part`, `field.member` or a derived column.

    An empty one if nothing is said.
    """
    if of is None:
        return _NOTHING
    key = id(of), column
    if (known := _known.get(key)) is None:
        if len(_known) >= _MOST_KNOWN:
            _known.clear()
        known = _known[key] = of, _found(of, column)
    return known[1]


def _found(of: Message | Packet, column: str) -> Meaning:
    note = of.notes.get(column)
    if note is not None:
        texts: dict[float, str] = {raw: text for table in (note.enum, note.special) for raw, text in table.items()}
        if note.scale is not None:
            texts = {raw * note.scale.numerator / note.scale.denominator: text for raw, text in texts.items()}
        return Meaning(note.unit, texts, note.clause, note)
    outer, _, last = column.rpartition(".")
    owner = of.notes.get(outer)
    for part in owner.parts if owner is not None else ():
        if part.name == last:
            named: dict[float, str] = {raw: text for raw, text in part.enum.items()}  # noqa: C416 - int keys to float
            return Meaning(part.unit, named, part.clause, part=part)
    for derived in of.derived:
        if derived.name == column:
            return Meaning(derived.unit, {}, derived.clause, source=derived.source)
    return Meaning()


def stands_for(note: Note | None, raw: Any) -> str:
    """Return what to write instead of a value computed from `raw`; empty if the value says it.

    A special value by its name, a code that people read in hexadecimal as it is where it is outside its limits.
    """
    if note is None or not isinstance(raw, int):
        return ""
    if raw in note.special:
        return note.special[raw]
    outside = (note.low is not None and raw < note.low) or (note.high is not None and raw > note.high)
    return f"0x{raw:02X}" if note.hex and outside else ""
