"""The result of a statistic: a table as plain data, which views write as text, JSON, CSV or Arrow."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

# How the cells of a column are written; None is what is not known. `time` is nanoseconds of the capture's clock, `span`
# a length in seconds, `since` seconds from the first frame, with all decimals however many; `stay` is a first and a
# last time, for people only: others have both as columns. So is `mark`, a word that says where to look.
ColumnKind = Literal["text", "count", "number", "time", "span", "since", "stay", "mark"]
FOR_PEOPLE = frozenset({"stay", "mark"})


@dataclass(frozen=True, slots=True)
class StatColumn:
    """A column of a statistic.

    `name` is that of machine formats, with its unit if it has one, `title` that of the text. Numbers are written with
    `digits` decimals, moments with 3 at least, and with more where that keeps them apart. A column of a `rank` above 0
    is left out of a text that has no room, the highest rank first, one below 0 of every text; one with a `bar` is
    drawn, too, where there is room.
    """

    name: str
    title: str
    kind: ColumnKind = "count"
    digits: int = 0
    rank: int = 0
    bar: bool = False


@dataclass(frozen=True, slots=True)
class StatTable:
    """A table of a statistic.

    `rows` are those of machine formats, `shown` those of the text if that is to be shorter (None: all of them); a text
    has a row `total` below them, and `notes` below that. `about` says what a row is. `indent` gives the depth of each
    row of a tree, `gaps` says what rows are that are not shown between others. Of the tables of a statistic one is the
    `main` one, which stands for it where there can be but one.
    """

    name: str
    about: str
    columns: Sequence[StatColumn]
    rows: Sequence[Sequence[Any]]
    notes: Sequence[str] = ()
    shown: Sequence[int] | None = None
    total: Sequence[Any] | None = None
    indent: Sequence[int] = ()
    gaps: str = ""
    main: bool = True

    def records(self) -> list[Mapping[str, Any]]:
        """Return a dictionary a row, by the names of columns."""
        return [dict(zip(self.names, row, strict=True)) for row in self.plain]

    @property
    def names(self) -> list[str]:
        """Names of the columns of machine formats."""
        return [column.name for column in self.columns if column.kind not in FOR_PEOPLE]

    @property
    def plain(self) -> list[Sequence[Any]]:
        """The rows of machine formats."""
        places = [k for k, column in enumerate(self.columns) if column.kind not in FOR_PEOPLE]
        return list(self.rows) if len(places) == len(self.columns) else [[row[k] for k in places] for row in self.rows]
