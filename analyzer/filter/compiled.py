"""Filters and expressions, ready to be evaluated over the batches of captures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.decode.packets import UNRECOGNIZED
from analyzer.filter.apart import apart, carriers
from analyzer.filter.conditions import Conditions
from analyzer.filter.history import columns_of
from analyzer.filter.language.parser import parse
from analyzer.filter.matcher import ExpressionMeter, Matcher, ReadValues
from analyzer.filter.memory import FilterMemory
from analyzer.filter.names import FilterNames
from analyzer.filter.operands import Operands
from analyzer.filter.sessions import may_select
from analyzer.window.numbering import Numbering

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

    from analyzer.decode.engine import Batch
    from analyzer.filter.conditions import AskedWord
    from analyzer.filter.memory import NamesFrames
    from analyzer.filter.nodes import Condition, LagNode, ValueNode
    from dissectors import Registry


class Filter:
    """A condition on rows, compiled once; for each capture make a `matcher`.

    Attributes:
        text: as it was written.
        words: texts that it asks for of which only a capture, its rules and its vehicle file know whether they exist.
    """

    def __init__(
        self, text: str, condition: Condition, lags: list[LagNode], registry: Registry, *, words: list[AskedWord],
        wireshark: bool,
    ) -> None:  # fmt: skip
        self.text, self.words = text, tuple(words)
        self._condition, self._lags, self._registry = condition, lags, registry
        self._wireshark = wireshark
        self._fields = list(condition.fields())

    @property
    def tables(self) -> frozenset[str]:
        """The message and packet tables that may have to be made."""
        memory = self._memory()
        found = {table for ref in self._fields if ref.origin == "table" for table in ref.tables}
        found |= {t for ref in self._fields if ref.origin == "type" for t in ref.tables if self._packet(t)}
        if any(ref.origin == "unit" for ref in self._fields):
            found |= {table for ref, _ in memory.unit_fields for table in ref.tables}
        if any(ref.origin == "channel" for ref in self._fields):
            found |= set(memory.channels.tables())
        return frozenset(found)

    def shown(self) -> frozenset[str] | None:
        """Return the tables that may have to be made to show what it selects, too; None for all there are."""
        some = carriers(self._condition, self._registry)
        if some is None:
            return None
        packets = {packet.name for family in self._registry.families() for packet in family.packets} | {UNRECOGNIZED}
        carrying = (message.table for message in self._registry.carriers() if message.table in some)
        return self.tables | some | {f"{one}.{packet}" for one in carrying for packet in packets}

    @property
    def asks_findings(self) -> bool:
        """True if it names findings: then a matcher needs the rules that name frames."""
        return any(ref.origin == "finding" for ref in self._fields)

    @property
    def asks_labels(self) -> bool:
        """True if it names labels of the vehicle file."""
        return any(ref.origin == "label" for ref in self._fields)

    def names(self) -> dict[str, tuple[str, ...]]:
        """Return the types and packets that it names, each with the tables that it may stand for."""
        found: dict[str, tuple[str, ...]] = {}
        for ref in self._fields:
            if ref.origin in ("table", "type"):
                found.setdefault(_called(ref.tables), ref.tables)
        return found

    @property
    def apart(self) -> str:
        """Why no row can match, since the messages that it asks for are never one; "" if some may."""
        none = carriers(self._condition, self._registry) == frozenset()
        return apart(self._condition) if none else ""

    def sessions(self, labels: Mapping[int, str]) -> Callable[[int, int, int, int], bool] | None:
        """Return what says of which sessions it may select transfers; None if it has to see those of all.

        What is read of a node may depend on all that it sends, and `frame.time_delta` on the row before.
        """
        if self.tables or any((ref.origin, ref.column) == ("frame", "delta") for ref in self._fields):
            return None
        memory = self._memory(labels=labels)
        return lambda *session: may_select(self._condition, memory, session)

    def never_seen(self, tables: Collection[str]) -> list[str]:
        """Return the types it names of which a capture with these tables has none, in the order of naming."""
        return [name for name, some in self.names().items() if not any(table in tables for table in some)]

    def matcher(
        self, *, numbering: Numbering | None = None, zero: int | None = None, labels: Mapping[int, str] | None = None,
        named: NamesFrames | None = None, severities: Mapping[str, str] | None = None, frame_list: bool = False,
    ) -> Matcher:  # fmt: skip
        """Return what evaluates it over one capture.

        Args:
            numbering: what frame numbers mean; whoever gives one feeds it each batch first.
            zero: the time that relative ones count from, that of the first frame if not given.
            labels: of nodes, by node ID.
            named: the rules that name frames.
            severities: of rules, by their names.
            frame_list: rows are frames, not transfers.
        """
        return Matcher(
            self._condition, self._lags, self._memory(numbering, zero, labels, named, severities, frame_list=frame_list)
        )

    def _packet(self, table: str) -> bool:
        return self._registry.message_of(table) is None

    def _memory(
        self, numbering: Numbering | None = None, zero: int | None = None, labels: Mapping[int, str] | None = None,
        named: NamesFrames | None = None, severities: Mapping[str, str] | None = None, *, frame_list: bool = False,
    ) -> FilterMemory:  # fmt: skip
        memory = FilterMemory(
            self._registry, numbering=numbering, zero=zero, labels=labels or {}, named=named,
            severities=severities or {}, frame_list=frame_list, columns=columns_of(self._fields),
        )  # fmt: skip
        if numbering is None:
            memory.numbering = Numbering(wireshark=self._wireshark)
        return memory


def _called(tables: tuple[str, ...]) -> str:
    """Return what to call tables that one name stands for: a packet wherever it is, both halves of a service."""
    outer, last = ({table.rpartition(".")[end] for table in tables} for end in (0, 2))
    return tables[0] if len(tables) == 1 else (last if len(last) == 1 else outer).pop()


class Expression:
    """A value of rows, compiled once: `feed(batch)` for each batch of one capture.

    Attributes:
        text: as it was written.
        unit: of the values, empty for none.
        flag: True if the values are flags.
        tables: the message and packet tables that it needs.
    """

    def __init__(self, text: str, value: ValueNode, lags: list[LagNode], registry: Registry) -> None:
        self.text, self.unit, self.flag = text, value.kind.unit, value.kind.sort == "flag"
        self.tables = frozenset(table for ref in value.fields() if ref.origin == "table" for table in ref.tables)
        memory = FilterMemory(
            registry, numbering=None, zero=None, labels={}, named=None, severities={}, frame_list=False,
            columns=columns_of(value.fields()),
        )  # fmt: skip
        self._meter = ExpressionMeter(value, lags, memory)

    def feed(self, batch: Batch) -> ReadValues:
        """Take the next batch and return the values, one a transfer row and all of them."""
        return self._meter.feed(batch)


def compile_filter(text: str, registry: Registry, *, wireshark: bool = False) -> Filter:
    """Return a filter.

    Args:
        text: the filter.
        registry: the types.
        wireshark: numbers of frames are Wireshark's, which counts error frames.

    Raises `FilterError`.
    """
    tree = parse(text)
    made = Conditions(text, FilterNames(registry))
    condition = made.make(tree)
    return Filter(text, condition, made.operands.lags, registry, words=made.words, wireshark=wireshark)


def compile_expression(text: str, registry: Registry) -> Expression:
    """Return an expression whose values are numbers. Raises `FilterError`."""
    tree = parse(text)
    operands = Operands(text, FilterNames(registry))
    value = operands.seconds(operands.number(tree))
    if carriers(value, registry) == frozenset():
        raise operands.fail(apart(value), tree)
    return Expression(text, value, operands.lags, registry)
