"""Names in filters: fixed ones, types, packets, and fields of them by any ending that only one has."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import pyarrow as pa

from analyzer.decode.columns import Description
from analyzer.facts.meaning import meaning
from analyzer.filter.fields import BYTES, ELSEWHERE, FIXED, FLAG, MEANT, PRESENT, TEXT, FieldRef, Kind
from analyzer.filter.language.errors import FilterError, listed, near
from analyzer.filter.language.literals import factor
from analyzer.filter.together import carried, same
from dissectors.layout import ArrayType, CompoundType
from dissectors.printed import printed
from dissectors.records import replace
from dissectors.schema import Message, Packet

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from analyzer.facts.meaning import Meaning
    from dissectors import Registry
    from dissectors.layout import Type

_OF_MESSAGES = {"bits_left": pa.int32(), "trusted": pa.bool_(), "decided": pa.bool_()}
_OF_PACKETS = {
    "packet_ok": pa.bool_(), "header_ok": pa.bool_(), "length_ok": pa.bool_(), "checksum_ok": pa.bool_(),
    "checksum_end": pa.uint8(), "count_step": pa.uint8(), "count_step_id": pa.uint8(), "offset": pa.uint32(),
    "big_endian": pa.bool_(), "decided": pa.bool_(),
}  # fmt: skip
UNSPECIFIED = "unspecified"  # in place of a unit that the document does not name
_MANY = 1 << 16  # elements of a list whose length nobody limits
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
        of = self.registry.definition(ref.tables[0]) if ref.origin == "table" else None
        known = {} if of is None else self.columns(of)
        meant = (name for name, one in known.items() if name.startswith(ref.column) and one.kind.unit)
        found = next((name for name in meant if factor(unit, known[name].kind.unit) is not None), "")
        return found and f"{ref.name.removesuffix(ref.column)}{found}"

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
            known = self._columns[id(of)] = dict(_columns_of(of))
        return known


def _columns_of(of: Message | Packet) -> Iterator[tuple[str, FieldRef]]:
    extra = dict(_OF_MESSAGES if isinstance(of, Message) else _OF_PACKETS)
    doubtful = of.readings if isinstance(of, Message) else of.numbers
    for name in () if doubtful else ("decided", "big_endian"):
        extra.pop(name, None)
    fields = [
        *Description(of.layout, of.notes, of.derived).fields,
        *(
            pa.field(
                f"{n}.unwrapped", pa.uint64() if note.scale is None else pa.float64(), metadata={"unit": note.unit}
            )
            for n, note in of.notes.items()
            if note.wraps
        ),
    ]
    if isinstance(of, Message):
        fields += [pa.field(f"reading.{reading.name}", pa.string()) for reading in of.readings]
    names = {field.name for field in fields}
    fields += [pa.field(name, kind) for name, kind in extra.items() if name not in names]
    for field in fields:
        for path, kind in _leaves(field.type, ()):
            dotted = ".".join((field.name, *path))
            ref = _ref(of, dotted, field, path, kind)
            if ref is None:
                continue
            yield dotted, ref
            for own, note in of.notes.items():
                if note.name and (dotted == own or dotted.startswith(f"{own}.")):
                    yield note.name + dotted.removeprefix(own), ref


def _leaves(kind: pa.DataType, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], pa.DataType]]:
    inner = kind.value_type if pa.types.is_list(kind) else kind
    if pa.types.is_struct(inner):
        for k in range(inner.num_fields):
            yield from _leaves(inner.field(k).type, (*path, inner.field(k).name))
    else:
        yield path, kind


def _ref(
    of: Message | Packet, dotted: str, field: pa.Field, path: tuple[str, ...], kind: pa.DataType
) -> FieldRef | None:
    found = meaning(of, dotted)
    about = {k.decode(): v.decode() for k, v in (field.metadata or {}).items()}
    clause = found.clause or about.get("clause", "")
    written = found.note is not None and found.note.text and pa.types.is_list(kind)
    leaf = kind.value_type if pa.types.is_list(kind) else kind
    if pa.types.is_list(leaf):
        return None
    if written or pa.types.is_string(leaf):
        column = field.name if path or not written else f"{field.name}.text"
        return FieldRef(dotted, "table", TEXT, column, path=path, clause=clause)
    sort = BYTES if _octets(found, kind) else FLAG if pa.types.is_boolean(leaf) else None
    made = sort or _numbers(found, leaf, found.unit or about.get("unit", ""))
    if sort is BYTES or pa.types.is_list(field.type) or pa.types.is_list(kind):
        made = replace(made, most=_most(of, (field.name, *path)))
    return FieldRef(dotted, "table", made, field.name, path=path, clause=clause)


def _most(of: Message | Packet, path: Sequence[str]) -> int:
    """Return how many elements a field has at most, of all lists that it lies in; `_MANY` if nothing limits them."""
    first, *rest = path
    source = next((one.source for one in of.derived if one.name == first), first)
    kind: Type = of.layout
    found = 1
    for step in (source, *rest):
        if not isinstance(kind, CompoundType):
            break
        kind = next((member.type for member in kind.fields if member.name == step), kind)
        if isinstance(kind, ArrayType):
            found, kind = found * kind.max, kind.element
    return found if found > 1 else _MANY


def _octets(found: Meaning, kind: pa.DataType) -> bool:
    hexadecimal = found.note is not None and found.note.hex
    return pa.types.is_binary(kind) or (hexadecimal and pa.types.is_list(kind) and kind.value_type == pa.uint8())


def _numbers(found: Meaning, leaf: pa.DataType, unit: str) -> Kind:
    """Return the kind of a number."""
    note, part = found.note, found.part
    scale = 1 if note is None or note.scale is None else note.scale
    low = high = None
    if pa.types.is_integer(leaf):
        bits = part.width if part is not None else leaf.bit_width
        signed = pa.types.is_signed_integer(leaf)
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    flags = [part for part in (() if note is None else note.parts) if part.flag]
    mask = sum(((1 << part.width) - 1) << part.low for part in flags)
    if note is not None and flags and len(flags) == len(note.parts):
        mask = high or mask  # bits without a name are flags of a word that has no others, too
    return Kind(
        "number",
        unit="" if unit == UNSPECIFIED else unit,
        texts={value: (text,) for value, text in found.texts.items()},
        closed=bool(note.enum if note is not None else part.enum if part is not None else ()),
        special=() if note is None else tuple(float(raw * scale) for raw in note.special),
        low=low,
        high=high,
        whole=pa.types.is_integer(leaf),
        mask=mask,
    )
