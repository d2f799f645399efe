"""Clauses, types, fields, parts and values by what they are called here, or what a document prints."""

from __future__ import annotations

import difflib
import re
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from analyzer.rules.catalogue import LAYERS
from dissectors import UnknownNameError
from dissectors.printed import printed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.rules.catalogue import Page
    from dissectors import Registry
    from dissectors.schema import Message, Note, Packet

_CLAUSE = re.compile(r"\d+(?:\.\d+)*(?:\s+(?:table|no|expl)\b.*)?", re.IGNORECASE)
_PLAIN = re.compile(r"[^a-z0-9]+")
_SEPARATORS = re.compile(r"[,;]\s*| and ")
_MOST_TYPES = 4  # that share a name
_NEAR = 3
_FAR = 0.3  # share that is the same, where nothing is nearer
_SHORTEST = 3  # letters of a word that is looked for inside of others


class Topic(NamedTuple):
    """A clause; or a message or packet by its table, a column of it, a raw value of that."""

    clause: str = ""
    table: str = ""
    column: str = ""
    value: int | None = None


class Lexicon:
    """Every name in use, of types of the vendors first.

    Args:
        registry: the types.
        pages: the rules.
    """

    def __init__(self, registry: Registry, pages: Mapping[str, Page]) -> None:
        self._registry, self._pages = registry, pages
        self.printed: dict[tuple[str, int | None], str] = {
            (path, value): text
            for profile in reversed(registry.profiles)
            for path, value, text in printed(profile.folder)
        }

    def find(self, word: str) -> list[Topic]:
        """Return what a word means, nothing if it is not known."""
        word = " ".join(word.split())
        if _CLAUSE.fullmatch(word) and (self._clause(word)):
            return [Topic(clause=word)]
        types = self._types(word)
        return types or self._named(self.described, word) or self._named(self._standard, word)

    def near(self, word: str) -> list[str]:
        """Return names that are nearly like a word."""
        lower = word.lower()
        names = dict.fromkeys([*LAYERS, *self._pages, *self._registry.names(), *self.clauses])
        for table, of in self.described.items():
            names |= dict.fromkeys([table.rpartition(".")[2], *(name for name, _ in _names(table, of))])
        names |= dict.fromkeys(self.printed.values())
        by_end = {name.rpartition(".")[2].lower(): name for name in reversed(names)}
        by_end |= {part: part for text in self.printed.values() for part in text.lower().split() if len(part) > 3}
        by_end |= {name.lower(): name for name in names}
        close = difflib.get_close_matches(lower, by_end, n=_NEAR) or difflib.get_close_matches(
            lower, by_end, n=_NEAR, cutoff=_FAR
        )
        return list(dict.fromkeys(by_end[name] for name in close))

    @cached_property
    def described(self) -> Mapping[str, Message | Packet]:
        """Every type, and packet, that a profile describes by itself, by its table."""
        found: dict[str, Message | Packet] = {}
        for profile in self._registry.profiles:
            for kind in ("message", "request", "response"):
                for name, body in profile.table.tables(kind):
                    message = profile.message(kind, body.string("type") or name)
                    if message.clause or "package" not in profile.table.body:
                        found.setdefault(message.table, message)
        return {**found, **self._registry.packets}

    @cached_property
    def clauses(self) -> tuple[str, ...]:
        """Every clause that something here is of."""
        found: dict[str, None] = {}
        for of in self.described.values():
            found |= dict.fromkeys([of.clause, *(note.clause for note in of.notes.values())])
        return tuple(filter(None, found))

    @cached_property
    def _standard(self) -> Mapping[str, Message | Packet]:
        return {table: self._registry.resolve(table) for table in self._registry.names() if table not in self.described}

    def _clause(self, word: str) -> bool:
        return any(within(clause, word) for clause in self.clauses) or any(self.rules(clause=word))

    def rules(self, *, clause: str = "", row: str = "", path: str = "") -> Iterator[str]:
        """Yield the rules of a clause and what is inside it, of one row of a table, or that judge a table or column."""
        for rule, page in self._pages.items():
            clauses = _SEPARATORS.split(page.clause)
            judged = path and any(within(one, path) for one in page.judged)
            if judged or (row and row in clauses) or (clause and any(within(one, clause) for one in clauses)):
                yield rule

    def _types(self, word: str) -> list[Topic]:
        if word.isdecimal() and len(word) <= len("65535"):
            found = [self._registry.message(kind, int(word)) for kind in (0, 2, 3)]
            return [Topic(table=message.table) for message in found if message is not None]
        packets = [table for table in self._registry.packets if _ends(table, word)]
        try:
            return [Topic(table=self._registry.table(word)), *(Topic(table=table) for table in packets)]
        except UnknownNameError as error:
            known = [table for table in error.candidates if f".{word.lower()}" in f".{table.lower()}"]
            return [Topic(table=table) for table in (packets or known[:_MOST_TYPES])]

    def _named(self, types: Mapping[str, Message | Packet], word: str) -> list[Topic]:
        """Return what has this name; if nothing has, what has these words in its name."""
        plain = _plain(word)
        if not plain:
            return []
        every = [
            (topic, name) for table, of in types.items() for name, topic in (*_names(table, of), *self._words(table))
        ]
        exact = [topic for topic, name in every if _ends(name, word) or _plain(name) == plain]
        if not exact and len(plain) >= _SHORTEST:
            own = ((topic, name.removeprefix(f"{topic.table}.")) for topic, name in every)
            exact = [topic for topic, name in own if f" {plain}" in f" {_plain(name)}"]
        return list(dict.fromkeys(exact))

    def _words(self, table: str) -> Iterator[tuple[str, Topic]]:
        """Yield the words that a document prints for a table."""
        for (path, value), text in self.printed.items():
            if self._registry.table_of(path) == table:
                yield text, Topic(table=table, column=path[len(table) + 1 :], value=value)


def within(clause: str, wanted: str) -> bool:
    """Return whether a clause is the one that is wanted, or inside it: 4.4.3 no 5 is in 4.4.3 and in 4.4."""
    return clause == wanted or (clause.startswith(wanted) and clause[len(wanted)] in " .")


def _names(table: str, of: Message | Packet) -> Iterator[tuple[str, Topic]]:
    """Yield the names of the columns of a table and of their values."""
    for member in of.layout.fields:
        if member.name:
            yield f"{table}.{member.name}", Topic(table=table, column=member.name)
    for field, note in of.notes.items():
        yield from _noted(table, field, note)
    for derived in of.derived:
        yield f"{table}.{derived.name}", Topic(table=table, column=derived.name)


def _noted(table: str, field: str, note: Note) -> Iterator[tuple[str, Topic]]:
    if note.name:
        yield f"{table}.{note.name}", Topic(table=table, column=field)
    yield from _values(table, field, {**note.enum, **note.special})
    for part in note.parts:
        column = f"{field}.{part.name}"
        for name in (f"{table}.{column}", part.called, *([f"{table}.{note.name}.{part.name}"] if note.name else [])):
            yield name, Topic(table=table, column=column)
        yield from _values(table, column, part.enum)


def _values(table: str, column: str, texts: Mapping[int, str]) -> Iterator[tuple[str, Topic]]:
    for value, text in texts.items():
        yield text, Topic(table=table, column=column, value=value)


def _ends(name: str, word: str) -> bool:
    return f".{name.lower()}".endswith(f".{word.lower()}")


def _plain(text: str) -> str:
    return _PLAIN.sub(" ", text.lower()).strip()
