"""The key `remarks`: what the line about a message says behind its summary, and when it has something to say."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.layout import PrimitiveType
from dissectors.notes import known_columns, template_of
from dissectors.only import only
from dissectors.records import dataclass
from dissectors.schema import Remark

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dissectors.layout import CompoundType
    from dissectors.schema import Bits, Derived, Note, Reading
    from dissectors.toml_table import TomlTable


@dataclass(frozen=True, slots=True)
class RemarkReader:
    """Reads the remarks of one message or packet, and checks them against what it has: a packet has no readings."""

    layout: CompoundType
    notes: Mapping[str, Note]
    derived: Mapping[str, Derived]
    readings: tuple[Reading, ...] | None = None

    def remarks(self, table: TomlTable) -> tuple[Remark, ...]:
        """Return the rows of the table's `remarks`, in their order."""
        return tuple(self._remarks(table))

    def _remarks(self, table: TomlTable) -> Iterator[Remark]:
        known = known_columns(self.layout, self.notes, self.derived)
        for body in table.rows("remarks"):
            column = body.string("of")
            found = Remark(
                column=column,
                text=template_of(body, "text", known),
                usual=body.integers("usual"),
                capitals=body.integers("capitals"),
                changes=body.flag("changes"),
                per=body.string("per"),
                only=None if self.readings is None else only(body),
            )
            body.finish()
            self._check(body, found)
            yield found

    def _check(self, body: TomlTable, found: Remark) -> None:
        note, part = self._of(found.column)
        if not found.column:
            if not found.text or set(body.body) != {"text"}:
                body.fail("a remark is `of` a column; without it `text` stands where there is no other, and alone")
            return
        if not self._number(found.column, part):
            body.fail(f"{found.column!r} is no whole number of {self.layout.name}, and no part of one", "of")
        named = part.flag or part.enum if part is not None else note is not None and note.enum
        if found.changes and not named:
            body.fail("only a flag, or a column whose values have names, changes from one name to another", "changes")
        if found.per and not self._number(found.per, None):
            body.fail(f"{found.per!r} is no whole number of {self.layout.name}", "per")
        if found.only is not None and not any(
            found.only.reading == one.name and found.only.choice in one.choices for one in self.readings or ()
        ):
            body.fail("no reading of this message has this choice", "only")

    def _of(self, column: str) -> tuple[Note | None, Bits | None]:
        outer, _, last = column.rpartition(".")
        owner = self.notes.get(outer)
        part = next((one for one in owner.parts if one.name == last), None) if owner is not None else None
        return (self.notes.get(column) if part is None else owner), part

    def _number(self, column: str, part: Bits | None) -> bool:
        kind = self.layout.member(column if part is None else column.rpartition(".")[0])
        return isinstance(kind, PrimitiveType) and kind.kind in ("int", "uint")
