"""The key `only`: what holds for rows of nodes that read a doubtful field in one way."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.records import dataclass

if TYPE_CHECKING:
    from dissectors.toml_table import TomlTable


@dataclass(frozen=True, slots=True)
class Only:
    """Holds for the rows of nodes that read a doubtful field in this way."""

    reading: str
    choice: str


def only(table: TomlTable) -> Only | None:
    """Read `only = "dialect=tm"`: rows of nodes that read it so."""
    text = table.string("only")
    reading, equals, choice = text.partition("=")
    if text and not (reading and equals and choice):
        table.fail("READING=CHOICE is expected", "only")
    return Only(reading, choice) if text else None
