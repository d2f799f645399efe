"""Names in filters: fixed ones, types, packets, and fields of them by any ending that only one has."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from analyzer.filter.described import fields_of
from analyzer.filter.fields import ELSEWHERE, FIXED, MEANT, PRESENT, FieldRef
from analyzer.filter.language.errors import FilterError, listed, near
from analyzer.filter.language.literals import factor, folded
from analyzer.filter.together import carried, same
from dissectors.printed import printed
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dissectors import Registry
    from dissectors.schema import Message, Packet

_LONGEST = 200  # characters of a name
_TELLING = 3  # letters of a word that can be near another one


class FilterNames:
    """Finds what names mean; types are compiled when a name needs them.

    Args:
        registry: the types.
    """

    def __init__(self, registry: Registry) -> None:
        self.registry = registry
        self._columns: dict[int, dict[str, FieldRef]] = {}

    def find(self, name: str, text: str, start: int) -> FieldRef:
        """Return what a name stands for. Raises `FilterError`, the place being in the filter `text`."""
        if name in FIXED:
            return FIXED[name]

        if len(name) > _LONGEST:
            raise FilterError(f"no field or type has a name as long as {name[:40]}...", text, start, start + len(name))

        def fail(reason: str, candidates: list[str], at: int = 0) -> FilterError:
            hint = f"{reason}: {listed(candidates)}" if candidates else reason
            return FilterError(hint, text, start + at, start + len(name), candidates)

        words = name.split(".")
        for cut in range(len(words), 0, -1):
            tables = self._tables(".".join(words[:cut]))
            if not tables:
                continue
            rest = ".".join(words[cut:])
            if not rest:
                if len(tables) > 1 and not same(tables):
                    raise fail(f"{name} may be any of these", [*MEANT.get(name.lower(), ()), *sorted(tables)])
                return FieldRef(name, "type", PRESENT, tables=tuple(tables))
            hits = [(table, found) for table in tables for found in self._ending(tables[table], rest)]
            if not hits:
                known = [
                    column for table in tables for column in (*carried(tables[table]), *self.columns(tables[table]))
                ]
                prefix = ".".join(words[:cut])
                known = sorted(dict.fromkeys(known), key=lambda column: "." in column)
                begun = [one for one in known if one.lower().startswith(rest.lower())]
                close = near(rest, known) or begun or [one for one in known if rest.lower() in one.lower()]
                meant = [f"{prefix}.{column}" for column in close]
                reason, at = f"{prefix} has no field {rest!r}", len(prefix) + 1
                if meant:
                    hint = f"{reason}; did you mean {listed(meant)}?"
                    raise FilterError(hint, text, start + at, start + len(name), meant)
                raise fail(f"{reason}; it has" if known else reason, known, at)
            return self._one(name, hits, fail)
        raise self._unknown(name, text, start)

    def _one(
        self, name: str, hits: list[tuple[str, FieldRef]], fail: Callable[[str, list[str]], FilterError]
    ) -> FieldRef:
        """Return the field that all of some tables have."""
        columns = {(found.column, found.path) for _, found in hits}
        if len(columns) > 1:
            raise fail(f"{name} may be any of these", [f"{table}.{found.name}" for table, found in hits])
        if len(hits) > 1 and not same({table: None for table, _ in hits}):
            raise fail(f"{name} may be any of these", [f"{table}.{found.name}" for table, found in hits])
        first = self._worded(*hits[0])
        return FieldRef(
            name, "table", first.kind, first.column, tuple(t for t, _ in hits), first.path, first.about, first.clause
        )

    def _worded(self, table: str, ref: FieldRef) -> FieldRef:
        """Return a field with the words that the document prints for its values, too."""
        if not ref.kind.closed:
            return ref
        path = ".".join((table, ref.column, *ref.path))
        said = self._printed.get(path, {})
        texts = {value: (*words, *said.get(value, ())) for value, words in ref.kind.texts.items()}
        return replace(ref, kind=replace(ref.kind, texts=texts))

    @cached_property
    def _printed(self) -> dict[str, dict[float, tuple[str, ...]]]:
        found: dict[str, dict[float, tuple[str, ...]]] = {}
        for profile in self.registry.profiles:
            for one in printed(profile.folder):
                if one.value is not None:
                    found.setdefault(one.path, {})[one.value] = (one.text,)
        return found

    def measured(self, ref: FieldRef, unit: str) -> str:
        """Return a field of the same type that begins with the name of another one and is in such a unit, or ""."""
        known = self._beside(ref)
        meant = (name for name, one in known.items() if name.startswith(ref.column) and one.kind.unit)
        found = next((name for name in meant if factor(unit, known[name].kind.unit) is not None), "")
        return found and f"{ref.name.removesuffix(ref.column)}{found}"

    def _beside(self, ref: FieldRef) -> dict[str, FieldRef]:
        """Return the fields of the type that has a field; none of what no type has."""
        found = map(self.registry.definition, ref.tables if ref.origin == "table" else ())
        of = next((one for one in found if one is not None), None)
        return {} if of is None else self.columns(of)

    def parts(self, ref: FieldRef, word: str) -> list[str]:
        """Return the flags below a field that are called so, and what is compared with such a word below it."""
        known = self._beside(ref)
        below = {n.removeprefix(ref.column): one for n, one in known.items() if n.startswith(f"{ref.column}.")}
        flags = [n for n, one in below.items() if one.kind.sort == "flag" and folded(n[1:]) == folded(word)]
        words = [
            f'{n} == "{text}"'
            for n, one in below.items()
            for text in (texts[0] for texts in one.kind.texts.values())
            if folded(text) == folded(word)
        ]
        return [f"{ref.name}{n}" for n in (*flags, *words)]

    def _unknown(self, name: str, text: str, start: int) -> FilterError:
        """Return the error for a name that nothing has."""
        known = [*FIXED, *self.registry.names()]
        instead = next((said for begin, said in ELSEWHERE.items() if name.lower().startswith(begin)), None)
        if instead is not None and name.lower() not in MEANT:
            return FilterError(f"no field is called {name!r}: {instead}", text, start, start + len(name))
        last = name.rpartition(".")[2]
        ends = list(self.with_ending(last))
        meant = list(MEANT.get(name.lower(), ()))
        meant += [one for one in ends if last == name and one not in meant]
        meant = meant or near(name, known) or ends
        meant = meant or (near(last, [k for k in known if "." not in k]) if len(last) >= _TELLING else [])
        meant = meant or [one for one in known if f".{name.lower()}." in one.lower()]  # of a vendor
        reason = f"no field or type is called {name!r}"
        reason += f"; did you mean {listed(meant)}?" if meant else "; tailbyte fields lists them"
        return FilterError(reason, text, start, start + len(name), meant)

    def type_called(self, name: str) -> tuple[str, list[str]]:
        """Return what `dronecan.type` says for a type, given by any name that only it has; "" and near ones if none."""
        if name in self._types:
            return name, []
        found = [self.registry.message_of(table) for table in self._tables(name)]
        called = sorted({one.name for one in found if one is not None})
        if len(called) == 1:
            return called[0], []
        short = {one.rpartition(".")[2]: one for one in self._types}
        ends = [short[one] for one in near(name, list(short))]
        return "", called or near(name, self._types) or ends or [t for t in self._types if name.lower() in t.lower()]

    @cached_property
    def _types(self) -> list[str]:
        every = map(self.registry.message_of, self.registry.names())
        return sorted({one.name for one in every if one is not None})

    def with_ending(self, name: str) -> Iterator[str]:
        """Yield the fields of all types whose last word is this."""
        for ref in FIXED:
            if ref.endswith(f".{name}"):
                yield ref
        for table, of in self._all():
            for found in self._ending(of, name):
                yield f"{table}.{found.name}"

    def _all(self) -> Iterator[tuple[str, Message | Packet]]:
        """Yield what has fields, packets too; compiles every type."""
        for table in self.registry.names():
            message = self.registry.message_of(table)
            if message is not None:
                yield table, message
        yield from self.registry.packets.items()

    def catalogue(self) -> Iterator[FieldRef]:
        """Yield every field by its whole name: fixed ones first. Compiles every type."""
        yield from FIXED.values()
        for table, of in self._all():
            yield FieldRef(table, "type", PRESENT, tables=(table,), about="the type occurs", clause=of.clause)
            for name, ref in self.columns(of).items():
                yield FieldRef(
                    f"{table}.{name}", "table", ref.kind, ref.column, (table,), ref.path, ref.about, ref.clause
                )

    def _tables(self, name: str) -> dict[str, Message | Packet]:
        """Return the tables that a name may mean: a type's, both halves of a service's, a packet's."""
        found: dict[str, Message | Packet] = {
            table: m for table in self.registry.named(name) if (m := self.registry.message_of(table)) is not None
        }
        return found or self._packets(name)

    def _packets(self, name: str) -> dict[str, Message | Packet]:
        outer, _, last = name.rpartition(".")
        kinds = {packet.name: packet for family in self.registry.families() for packet in family.packets}
        packet = kinds.get(last) or next((p for n, p in kinds.items() if n.lower() == last.lower()), None)
        if packet is None:
            return {}
        if outer:
            found = self.registry.named(outer)
            carriers = [one for one in self.registry.carriers() if found == [one.table]]
            return {f"{carrier.table}.{packet.name}": packet for carrier in carriers}
        return {f"{carrier.table}.{packet.name}": packet for carrier in self.registry.carriers()}

    def _ending(self, of: Message | Packet, rest: str) -> list[FieldRef]:
        columns = self.columns(of)
        if rest in columns:
            return [columns[rest]]
        lower = rest.lower()
        found = [r for name, r in columns.items() if name.endswith(f".{rest}")]
        found = found or [
            r for name, r in columns.items() if name.lower() == lower or name.lower().endswith(f".{lower}")
        ]
        return list({(r.column, r.path): r for r in found}.values())

    def columns(self, of: Message | Packet) -> dict[str, FieldRef]:
        """Return the fields of a message or packet by name, display names too."""
        known = self._columns.get(id(of))
        if known is None:
            known = self._columns[id(of)] = dict(fields_of(of))
        return known
