"""Clauses, types, fields and values as pages for a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.facts.meaning import meaning
from analyzer.report.lines import right, wrap
from analyzer.report.topics.finding import Topic, within
from analyzer.report.wording import safe
from analyzer.rules.exercised.coverage import never
from analyzer.views.terminal import PLAIN, Palette
from dissectors.schema import ArrayType, CompoundType, Message

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from fractions import Fraction

    from analyzer.report.topics.finding import Lexicon
    from analyzer.rules.catalogue import Page
    from dissectors import Registry
    from dissectors.schema import Bits, Note, Packet, Type

WIDTH = 80
_LABEL = 10
_NAME, _TYPE = 28, 11
_NARROWEST = 60
_MOST_IN_FULL = 6


class Pages:
    """Writes topics.

    Args:
        lexicon: what is known, and what documents print.
        registry: the types.
        rules: the pages of the rules.
        width: columns, 60 at least.
        palette: colours for a terminal.
    """

    def __init__(
        self,
        lexicon: Lexicon,
        registry: Registry,
        rules: Mapping[str, Page],
        *,
        width: int = WIDTH,
        palette: Palette = PLAIN,
    ) -> None:
        self._lexicon, self._registry, self._rules = lexicon, registry, rules
        self._width, self._palette = max(width, _NARROWEST), palette

    def write(self, topics: list[Topic]) -> str:
        """Write a page for each topic; of many only what they are."""
        if len(topics) > _MOST_IN_FULL:
            lines = [line for topic in topics for line in self._entry(topic)]
            return "".join(f"{line.rstrip()}\n" for line in lines)
        return "\n".join("".join(f"{line.rstrip()}\n" for line in self._page(topic)) for topic in topics)

    def _page(self, topic: Topic) -> Iterator[str]:
        if topic.clause:
            yield from self._clause(topic.clause)
            return
        of = self._registry.definition(topic.table)
        if of is None:
            return
        yield from self._column(topic, of) if topic.column else self._type(topic.table, of)

    def _head(self, name: str, what: str, end: str) -> Iterator[str]:
        lines = wrap(safe(what), self._width, first=f"{safe(name)}  ", indent=" " * _LABEL)
        first, *more = right(lines, safe(end), self._width)
        yield self._palette.paint("head", first)
        yield from more

    def _labelled(self, label: str, text: str) -> Iterator[str]:
        if text:
            start = f"{label:<{_LABEL}}"
            first, *more = wrap(safe(text), self._width, first=start, indent=" " * _LABEL)
            yield self._palette.paint("dim", label) + first[len(label) :]
            yield from more

    def _clause(self, clause: str) -> Iterator[str]:
        described = self._lexicon.described
        types = [table for table, of in described.items() if of.clause == clause]
        inside = [table for table, of in described.items() if of.clause != clause and within(of.clause, clause)]
        fields = [
            Topic(table=table, column=column)
            for table, of in described.items()
            for column, note in of.notes.items()
            if within(note.clause, clause) and table not in (*types, *inside)
        ]
        yield from self._head(f"Clause {clause}", "", "")
        for table in types:
            yield ""
            yield from self._type(table, described[table], ruled=False)
        if inside or fields:
            yield ""
        for topic in [*(Topic(table=table) for table in inside), *fields]:
            yield from self._entry(topic)
        rules = list(self._lexicon.rules(clause=clause))
        hidden = [text for text in never(self._registry) if within(text.partition(" (")[0], clause)]
        if hidden:
            yield ""
        for text in hidden:
            yield from wrap(safe(text), self._width, first="No capture can show ", indent=" " * _LABEL)
        if rules:
            yield ""
        for rule in rules:
            page = self._rules[rule]
            yield from wrap(safe(page.title), self._width, first=f"{rule:<{_LABEL}}", indent=" " * _LABEL)

    def _entry(self, topic: Topic) -> Iterator[str]:
        """Say in a line what something is."""
        of = self._registry.definition(topic.table)
        if of is None:
            return
        name = topic.table + (f".{topic.column}" if topic.column else "")
        what = _identity(of) if not topic.column else self._short(topic, of)
        clause = of.clause if not topic.column else meaning(of, topic.column).clause
        yield from right(wrap(safe(what), self._width, first=f"{safe(name)}  ", indent="  "), safe(clause), self._width)

    def _short(self, topic: Topic, of: Message | Packet) -> str:
        if topic.value is None:
            return self._print(topic)
        return f"{topic.value} {self._value(topic, of)}"

    def _value(self, topic: Topic, of: Message | Packet) -> str:
        about = meaning(of, topic.column)
        texts = _texts(about.note, about.part)
        own = texts.get(topic.value, "") if topic.value is not None else ""
        return " ".join(filter(None, [own, self._print(topic)]))

    def _print(self, topic: Topic) -> str:
        text = self._lexicon.printed.get((f"{topic.table}.{topic.column}", topic.value), "")
        return f'(printed "{text}")' if text else ""

    def _type(self, table: str, of: Message | Packet, *, ruled: bool = True) -> Iterator[str]:
        yield from self._head(table, _identity(of), of.clause)
        if isinstance(of, Message):
            names = [name for name in (of.full_name, *of.aliases) if name != table]
            yield from self._labelled("Also", ", ".join(names))
            yield from self._labelled("Signature", f"{of.signature:016X}")
            inside = () if of.packets is None else of.packets.packets
            yield from self._labelled("Packets", ", ".join(f"{one.name} 0x{one.id:02X}" for one in inside))
        yield from [""] if any(member.name for member in of.layout.fields) else []
        for member in of.layout.fields:
            if member.name:
                yield from self._field(table, member.name, _kind(member.type), of)
        for derived in of.derived:
            yield from self._row(f"[{derived.name}]", "", f"{derived.unit}, from {derived.source}".strip(", "), "")
        if ruled:
            rules = ", ".join(self._lexicon.rules(path=table))
            yield from ["", *self._labelled("Rules", rules)] if rules else []

    def _field(self, table: str, column: str, kind: str, of: Message | Packet) -> Iterator[str]:
        note = of.notes.get(column)
        own = note.clause.removeprefix(of.clause).strip() if note is not None else ""
        name = f"{note.name} ({column})" if note is not None and note.name else column
        yield from self._row(name, kind, ", ".join(_about(note, None)), own)
        for part in note.parts if note is not None else ():
            said = [
                *_about(None, part),
                "tentative" if part.tentative else "",
                self._print(Topic(table=table, column=f"{column}.{part.name}")),
            ]
            yield from self._row(f"  {part.name}", _place(part), ", ".join(filter(None, said)), "")

    def _row(self, name: str, kind: str, text: str, end: str) -> Iterator[str]:
        start = f"  {safe(name):<{_NAME}} {kind:<{_TYPE}}"
        lines = wrap(safe(text), self._width, first=f"{start} ", indent=" " * (_NAME + 4))
        yield from right(lines, end, self._width) if end else lines

    def _column(self, topic: Topic, of: Message | Packet) -> Iterator[str]:
        about = meaning(of, topic.column)
        outer = topic.column.rpartition(".")[0] if about.part is not None else topic.column
        kind = of.layout.member(outer)
        what = _place(about.part) if about.part is not None else "" if kind is None else _kind(kind)
        yield from self._head(f"{topic.table}.{topic.column}", what, about.clause)
        yield from self._labelled("In", f"{topic.table}, {_identity(of)}")
        name = about.note.name if about.note is not None else ""
        yield from self._labelled("Name", about.part.called if about.part is not None else name)
        yield from self._labelled("Printed", self._lexicon.printed.get((f"{topic.table}.{topic.column}", None), ""))
        if about.source:
            yield from self._labelled("From", about.source)
        if topic.value is not None:
            hexa = f"{topic.value} (0x{topic.value:02X})" if topic.value > 9 else str(topic.value)
            yield from self._labelled("Value", f"{hexa}: {self._value(topic, of)}")
        else:
            yield from self._labelled("Unit", about.unit)
            yield from self._labelled("Range", _range(about.note, about.part))
            texts = _texts(about.note, about.part).items()
            yield from self._labelled("Values", ", ".join(f"{value} {text}" for value, text in texts))
            parts = about.note.parts if about.note is not None else ()
            yield from self._labelled("Parts", ", ".join(f"{part.name} ({_place(part)})" for part in parts))
        rules = self._lexicon.rules(path=f"{topic.table}.{topic.column}", row=about.clause)
        yield from self._labelled("Rules", ", ".join(rules))


def _identity(of: Message | Packet) -> str:
    if not isinstance(of, Message):
        return f"packet 0x{of.id:02X}, {of.length} bytes"
    size = f"{of.min_bytes}" if of.min_bytes == of.max_bytes else f"{of.min_bytes} to {of.max_bytes}"
    return f"{of.kind} {of.type_id}, {size} bytes"


def _kind(kind: Type) -> str:
    """Return a type as DSDL writes it."""
    if isinstance(kind, ArrayType):
        return f"{_kind(kind.element)}[{'<=' if kind.dynamic else ''}{kind.max}]"
    return kind.name.rpartition(".")[2] if isinstance(kind, CompoundType) else f"{kind.kind}{kind.bits}"


def _place(part: Bits) -> str:
    return f"bit {part.low}" if part.low == part.high else f"bits {part.low}-{part.high}"


def _about(note: Note | None, part: Bits | None) -> Iterator[str]:
    one = note or part
    if one is None:
        return
    yield from [one.unit] if one.unit else []
    yield from [text] if (text := _range(note, part)) else []
    yield from (f"{value} {text}" for value, text in _texts(note, part).items())


def _range(note: Note | None, part: Bits | None) -> str:
    """Return the limits of the raw value in words, scaled where it is."""
    low, high, scale = (None, None, None) if note is None else (note.low, note.high, note.scale)
    if note is not None and note.hex and low is not None and high is not None:
        return f"0x{int(low):02X} to 0x{int(high):02X}"
    if part is not None:
        low, high, scale = part.low_limit, part.high_limit, part.scale
    if low is None or high is None:
        return (
            ""
            if low is high
            else f"at least {_number(low, scale)}"
            if high is None
            else f"at most {_number(high, scale)}"
        )
    return f"{_number(low, scale)} to {_number(high, scale)}"


def _number(limit: Fraction | None, scale: Fraction | None) -> str:
    return "" if limit is None else f"{float(limit * (scale or 1)):g}"


def _texts(note: Note | None, part: Bits | None) -> Mapping[int, str]:
    if part is not None:
        return part.enum
    return {} if note is None else {**note.enum, **note.special}
