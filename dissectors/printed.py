"""Words that a document prints, by what they are called in its profile: `printed.toml` of a dissector's folder."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from dissectors.keys import PRINTED
from dissectors.toml_table import read

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

FILE = "printed.toml"


class Printed(NamedTuple):
    """A word of the document for the column `path` (`MESSAGE.FIELD`), or for one raw value of it."""

    path: str
    value: int | None
    text: str


def printed(folder: Path) -> Iterator[Printed]:
    """Yield what the file of a folder says, nothing without one. Raises `ProfileError`."""
    file = folder / FILE
    if not file.is_file():
        return
    table = read(file, PRINTED)
    names, values = table.table("name"), table.table("value")
    for path in names.body:
        yield Printed(path, None, names.string(path))
    for path in values.body:
        for value, text in values.texts(path).items():
            yield Printed(path, value, text)
    table.finish()
