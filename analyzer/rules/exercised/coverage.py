"""Coverage.

What a capture exercised of all that its dissectors describe: types, packets, values with names, clauses.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.facts.meaning import meaning
from analyzer.rules.verdicts import RANKED
from analyzer.tables import counted
from dissectors.keys import CLAUSES
from dissectors.records import dataclass, field
from dissectors.toml_table import read

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from analyzer.rules.catalogue import Page
    from analyzer.rules.verdicts import Ruling, Verdict
    from dissectors import Registry
    from dissectors.kit import View
    from dissectors.schema import Message, Packet

FILE = "clauses.toml"
MOST_TYPES = 4096
_CLAUSE = re.compile(r"(?<![\w.])\d+(?:\.\d+)+|^\d+(?= \()")


@dataclass(frozen=True, slots=True)
class Seen:
    """Counts by name, with 0 for what is described and was not seen. `values` are by field and name of a value."""

    types: Mapping[str, int] = field(default_factory=dict)
    packets: Mapping[str, int] = field(default_factory=dict)
    values: Mapping[str, Mapping[str, int]] = field(default_factory=dict)


class Tracker:
    """Counts over batches, trusted rows only. A type counts as described if its profile gives it a clause."""

    def __init__(self, registry: Registry) -> None:
        self._described = list(described(registry))
        self._types = {message.table: 0 for message in self._described}
        self._families = registry.families()
        self._packets = {packet.name: 0 for family in self._families for packet in family.packets}
        self._carriers = tuple(message.table for message in registry.carriers())
        # field -> (table, column, texts by raw value)
        self._fields = {name: texts for name, *_, texts in self._enums()}
        self._columns: dict[str, list[tuple[str, str]]] = {}
        for name, table, column, _ in self._enums():
            self._columns.setdefault(table, []).append((column, name))
        self._values = {name: dict.fromkeys(texts, 0) for name, texts in self._fields.items()}

    def feed(self, view: View) -> None:
        """Add the next batch."""
        for name in view.tables():
            carrier, _, packet = name.partition(".")
            inner = carrier in self._carriers and packet in self._packets
            table = view.table(name)
            if table is None:
                continue
            count = table.good
            if inner:
                self._packets[packet] += count
            elif name in self._types or (len(self._types) < MOST_TYPES and carrier not in self._carriers):
                self._types[name] = self._types.get(name, 0) + count
            for column, field_ in self._columns.get(name, ()):
                if column in table:
                    good = table.has(column) if count == len(table) else table.trusted & table.has(column)
                    self._count(field_, table[column] if good.all() else table[column][good])

    def finish(self) -> Seen:
        """Return everything so far."""
        values = {
            name: {text: sum(counts[raw] for raw, other in self._fields[name].items() if other == text)
                   for text in dict.fromkeys(self._fields[name].values())}
            for name, counts in self._values.items()
        }  # fmt: skip
        return Seen(dict(self._types), dict(self._packets), values)

    def _count(self, name: str, values: Any) -> None:
        counts = self._values[name]
        if values.dtype.kind in "iu":
            for raw, often in zip(*counted(values), strict=True):
                if raw in counts:
                    counts[raw] += often
            return
        for known in counts:
            counts[known] += int(np.count_nonzero(values == known))

    def _enums(self) -> Iterator[tuple[str, str, str, Mapping[float, str]]]:
        """Yield every field whose values have names: its name, table, column, texts."""
        for message in self._described:
            for column in _columns(message):
                if texts := _texts(message, column):
                    yield f"{message.table}.{column}", message.table, column, texts
        for carrier in self._carriers:
            for family in self._families:
                for packet in family.packets:
                    for column in _columns(packet):
                        if texts := _texts(packet, column):
                            yield f"{packet.name}.{column}", f"{carrier}.{packet.name}", column, texts


def _texts(of: Message | Packet, column: str) -> Mapping[float, str]:
    """Return names of values; none for a field that is a number with one special value."""
    found = meaning(of, column)
    named = found.part.enum if found.part is not None else found.note.enum if found.note is not None else {}
    return found.texts if named else {}


def _columns(of: Message | Packet) -> Iterator[str]:
    for name, note in of.notes.items():
        if note.enum:
            yield name
        yield from (f"{name}.{part.name}" for part in note.parts if part.enum)


def described(registry: Registry) -> Iterator[Message]:
    """Yield the messages that a profile lists with the clause of a document."""
    for profile in registry.profiles:
        for name, body in profile.table.tables("message"):
            if body.string("clause"):
                yield profile.message("message", body.string("type") or name)


def clauses(pages: Mapping[str, Page], rulings: Mapping[str, Ruling]) -> dict[str, Verdict]:
    """Return the worst verdict of all rules of a clause; a clause is exercised if one of its rules is."""
    found: dict[str, Verdict] = {}
    for rule, page in pages.items():
        for clause in clauses_of(page.clause):
            here = rulings[rule].verdict
            found[clause] = min(found.get(clause, here), here, key=RANKED.index)
    return dict(sorted(found.items(), key=lambda item: [int(part) for part in item[0].split(".")]))


def clauses_of(text: str) -> list[str]:
    """Return the numbers of a page's `clause`, without tables and rows."""
    return list(dict.fromkeys(_CLAUSE.findall(text)))


def never(registry: Registry) -> tuple[str, ...]:
    """Return clauses that no capture can show, as the folders of dissectors list them. Raises `ProfileError`."""
    found = []
    for profile in registry.profiles:
        file = profile.folder / FILE
        if file.is_file():
            table = read(file, CLAUSES)
            for row in table.rows("never"):
                found.append(f"{row.string('clause')} ({row.string('why')})")
                row.finish()
            table.finish()
    return tuple(found)


def added(several: Sequence[Seen]) -> Seen:
    """Add up all captures."""
    fields = dict.fromkeys(name for one in several for name in one.values)
    return Seen(
        _sum(one.types for one in several),
        _sum(one.packets for one in several),
        {name: _sum(one.values.get(name, {}) for one in several) for name in fields},
    )


def _sum(counts: Iterable[Mapping[str, int]]) -> dict[str, int]:
    total: dict[str, int] = {}
    for one in counts:
        for name, count in one.items():
            total[name] = total.get(name, 0) + count
    return total
