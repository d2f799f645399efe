"""The reading of a doubtful field that each node uses, from the evidence that its dissector lists."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pyarrow as pa

from analyzer.facts.meaning import meaning
from analyzer.tables import distinct
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.schema import Evidence, Message, Reading


Node = tuple[int, int]  # bus, node ID


class Statement(NamedTuple):
    """One node's reading of `field`: one of the choices, or "undecided"."""

    message: str
    reading: str
    field: str
    bus: int
    node: int
    choice: str


def checked(dialects: Mapping[int, Collection[str]], registry: Registry) -> Mapping[int, Collection[str]]:
    """Return the same dialects. Raises `ValueError` for a choice that no doubtful field has."""
    if not dialects:
        return dialects
    messages = (body for profile in registry.profiles for _, body in profile.table.tables("message"))
    choices = [choice for body in messages for _, one in body.tables("reading") for choice in one.strings("choices")]
    for node, given in dialects.items():
        for choice in given:
            if choice not in choices:
                known = f"one of: {', '.join(dict.fromkeys(choices))}" if choices else "no field is doubtful"
                raise ValueError(f"dialect {node}={choice}: no field is read as {choice!r} ({known})")
    return dialects


class Dialects:
    """Collects evidence over batches. Only rows with a good CRC count.

    Args:
        forced: choices by node ID that stand against any evidence.
    """

    def __init__(self, forced: Mapping[int, Collection[str]] | None = None) -> None:
        self._forced = forced or {}
        # (message table, reading, evidence) -> node -> seen inside the limits, seen outside of them
        self._seen: dict[tuple[str, int, int], dict[Node, tuple[bool, bool]]] = {}
        self._messages: dict[str, Message] = {}
        self._nodes: dict[str, set[Node]] = {}

    def feed(self, message: Message, table: pa.RecordBatch) -> None:
        """Add a batch of one message."""
        trusted = numbers(table.column("trusted"))
        nodes = (numbers(table.column("bus")).astype(np.int64) << 8 | numbers(table.column("src")))[trusted]
        self._nodes.setdefault(message.name, set()).update(map(_node, distinct(nodes)))
        if not message.readings:
            return
        self._messages[message.table] = message
        for r, reading in enumerate(message.readings):
            for e, evidence in enumerate(reading.evidence):
                if evidence.field in table.schema.names:
                    seen = self._seen.setdefault((message.table, r, e), {})
                    self._note(seen, message, evidence, table.column(evidence.field).filter(pa.array(trusted)), nodes)

    def _note(
        self, seen: dict[Node, tuple[bool, bool]], message: Message, evidence: Evidence, column: pa.Array, nodes: Array
    ) -> None:
        values, nodes = _flat(column, nodes)
        good = np.isfinite(values)
        values, nodes = values[good], nodes[good]
        low, stop = _limits(message, evidence)
        inside = (values >= low) & (values < stop)
        hits, misses = distinct(nodes[inside]), distinct(nodes[~inside])
        for code in {*hits, *misses}:
            hit, miss = seen.get(_node(code), (False, False))
            seen[_node(code)] = (hit or code in hits, miss or code in misses)

    def choice(self, message: str, reading: str, node: Node) -> str:
        """Return what one node's reading of a message's field is so far, empty if there is no such reading."""
        for table, known in self._messages.items():
            for r, found in enumerate(known.readings):
                if known.name == message and found.name == reading:
                    return self._choice(table, r, found, node)
        return ""

    def statements(self) -> Iterator[Statement]:
        """Yield a statement for each node that sends a message with doubtful fields, by node."""
        for table, message in self._messages.items():
            for r, reading in enumerate(message.readings):
                for node in sorted(self._nodes.get(message.name, ())):
                    yield Statement(
                        message.name, reading.name, reading.field, *node, self._choice(table, r, reading, node)
                    )

    def _choice(self, table: str, r: int, reading: Reading, node: Node) -> str:
        for choice in self._forced.get(node[1], ()):
            if choice in reading.choices:
                return f"{choice} (forced)"
        for e, evidence in enumerate(reading.evidence):
            if evidence.sends:
                holds = any(node in self._nodes.get(name, ()) for name in evidence.sends)
            else:
                hit, miss = self._seen.get((table, r, e), {}).get(node, (False, False))
                holds = hit and not (evidence.every and miss)
            if holds:
                return evidence.choice
        return reading.otherwise or "undecided"


def _node(code: int) -> Node:
    return code >> 8, code & 0xFF


def _flat(column: pa.Array, nodes: Array) -> tuple[Array, Array]:
    """Return numbers as floats, with the node of each; missing ones are NaN."""
    if pa.types.is_list(column.type):
        nodes = np.repeat(nodes, np.asarray(column.value_lengths().fill_null(0)))
        column = column.flatten()
    return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False)), nodes


def _limits(message: Message, evidence: Evidence) -> tuple[float, float]:
    """Return the limits in the unit of the column; they are given raw."""
    about = meaning(message, evidence.field)
    scale = next((found.scale for found in (about.note, about.part) if found is not None and found.scale), 1)
    low = -np.inf if evidence.low is None else float(evidence.low * scale)
    stop = np.inf if evidence.stop is None else float(evidence.stop * scale)
    return low, stop
