"""The reading of each node's doubtful fields, from the evidence that its dissector lists, and what rows say of it.

A node is decided as soon as no further evidence can change it, else by its first `ENOUGH` good transfers, else by all
of them at the end; what is decided stays. Raw values stay, too: a row says which reading holds for it and whether that
was decided, and columns that follow a reading are computed by it. Where rows can wait, all of a batch are read as the
node turns out in it; else those before the decision follow their own values, wherever the capture is cut into batches.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pyarrow as pa

from analyzer.decode.columns import linear, senders
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from dissectors.kit import Array
    from dissectors.schema import Derived, Evidence, Message, Reading

ENOUGH = 50  # good transfers of a node
UNDECIDED = "undecided"
FORCED = " (forced)"
_NODES = 1 << 16
_NEVER = np.iinfo(np.uint64).max


class Statement(NamedTuple):
    """One node's reading of `field`: one of the choices, or "undecided"."""

    message: str
    reading: str
    field: str
    bus: int
    node: int
    choice: str


def reading_column(name: str) -> str:
    """Return the column that says how a row's doubtful field is read."""
    return f"reading.{name}"


class Readings:
    """The readings of all nodes, taken in batch by batch.

    Args:
        messages: those with doubtful fields.
        forced: choices by node ID that stand against any evidence.
        ahead: rows wait for the end of their batch.
    """

    def __init__(self, messages: Iterable[Message], forced: Mapping[int, Collection[str]], *, ahead: bool) -> None:
        self._ahead = ahead
        self._sent: dict[str, Array] = {}  # message that is evidence -> from which transfer on a node has sent it
        self._courses: dict[str, list[_Course]] = {}
        for message in messages:
            names = [name for reading in message.readings for one in reading.evidence for name in one.sends]
            self._sent |= {name: np.full(_NODES, _NEVER, np.uint64) for name in names if name not in self._sent}
            self._courses[message.table] = [_Course(message, one, forced, self._sent) for one in message.readings]

    def know(self, other: Readings) -> None:
        """Take over what another one has decided."""
        for name, courses in self._courses.items():
            for mine, known in zip(courses, other._courses[name], strict=True):
                mine.know(known)

    @property
    def waiting(self) -> bool:
        """True if a node has shown something that does not decide it."""
        return any(course.waiting for courses in self._courses.values() for course in courses)

    def learn(self, tables: Mapping[str, pa.RecordBatch], *, last: bool) -> None:
        """Take in the message tables of a batch; with the `last` one every node is decided."""
        for name in self._sent.keys() & tables.keys():
            table = tables[name]
            good = numbers(table.column("trusted"))
            np.minimum.at(self._sent[name], senders(table)[good], numbers(table.column("transfer"))[good])
        for name, courses in self._courses.items():
            for course in courses:
                if name in tables:
                    course.learn(tables[name])
                if last:
                    course.end(ahead=self._ahead)

    def told(self, table: str, rows: pa.RecordBatch) -> pa.RecordBatch:
        """Return the rows of a table as their nodes' readings have them, with a column that says so for each."""
        courses = self._courses.get(table)
        if courses is None:
            return rows
        decided = np.ones(len(rows), bool)
        columns = dict(zip(rows.schema, rows.columns, strict=True))
        more: list[tuple[pa.Field, pa.Array]] = []
        for course in courses:
            code, known = course.codes(rows, ahead=self._ahead)
            decided &= known
            for column in course.message.derived:
                if column.reading == course.reading.name:
                    at = rows.schema.field(column.name)
                    columns[at] = course.followed(column, code, rows)
            more.append((pa.field(reading_column(course.reading.name), pa.string()), course.named(code)))
        more.append((pa.field("decided", pa.bool_()), pa.array(decided)))
        own = list(columns.items())
        at = rows.schema.get_field_index("layout") + 1
        pairs = [*own[:at], *more, *own[at:]]
        schema = pa.schema([one for one, _ in pairs], metadata=rows.schema.metadata)
        return pa.RecordBatch.from_arrays([column for _, column in pairs], schema=schema)

    def statements(self) -> Iterator[Statement]:
        """Yield what is known of each node that sends a message with doubtful fields."""
        for courses in self._courses.values():
            for course in courses:
                yield from course.statements()


@dataclass(slots=True)
class _Shown:
    """Shown by a node that is not decided: good rows, and for each evidence whether some spoke for or against."""

    hits: list[bool]
    misses: list[bool]
    rows: int = 0


@dataclass(slots=True)
class _Course:
    """One reading of one message, for all nodes."""

    message: Message
    reading: Reading
    forced: Mapping[int, Collection[str]]
    sent: Mapping[str, Array]
    _code: Array = field(init=False)  # 0 is undecided, else the number of the choice, from 1
    _since: Array = field(init=False)  # the first transfer that is decided
    _done: Array = field(init=False)
    _seen: Array = field(init=False)
    _shown: dict[int, _Shown] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        """Begin without evidence; what is forced is decided."""
        self._code, self._since = np.zeros(_NODES, np.uint8), np.full(_NODES, _NEVER, np.uint64)
        self._done, self._seen = np.zeros(_NODES, bool), np.zeros(_NODES, bool)
        for node in self.forced:
            if (choice := self._wanted(node)) is not None:
                mine = np.arange(_NODES) & 0xFF == node
                self._code[mine], self._since[mine], self._done[mine] = self._number(choice), 0, True

    def _wanted(self, node: int) -> str | None:
        return next((one for one in self.forced.get(node, ()) if one in self.reading.choices), None)

    def _number(self, choice: str) -> int:
        return self.reading.choices.index(choice) + 1 if choice else 0

    @property
    def waiting(self) -> bool:
        """True if a node has shown something that does not decide it."""
        return bool(self._shown)

    def know(self, other: _Course) -> None:
        """Take over what another one has decided, but not who was seen."""
        self._code, self._done = other._code.copy(), other._done.copy()
        self._since[self._done] = 0

    # ---- evidence

    def learn(self, table: pa.RecordBatch) -> None:
        """Take in rows of the message, as far as they are from nodes that are not decided."""
        nodes, trusted = senders(table), numbers(table.column("trusted"))
        self._seen[nodes[trusted]] = True
        rows = np.flatnonzero(trusted & ~self._done[nodes])
        if not rows.size:
            return
        rows = rows[np.argsort(nodes[rows], kind="stable")]
        groups = np.split(rows, np.flatnonzero(np.diff(nodes[rows])) + 1)
        for some in groups:
            self._look(int(nodes[some[0]]), table, some)

    def _look(self, node: int, table: pa.RecordBatch, rows: Array) -> None:
        """Add rows of one node until it is decided."""
        count = len(self.reading.evidence)
        shown = self._shown.setdefault(node, _Shown([False] * count, [False] * count))
        rows = rows[: ENOUGH - shown.rows]
        transfers = numbers(table.column("transfer"))[rows]
        spoken = [self._spoken(one, node, table, rows, transfers) for one in self.reading.evidence]
        for k in range(len(rows)):
            shown.rows += 1
            for e, (hits, misses) in enumerate(spoken):
                shown.hits[e] |= bool(hits[k])
                shown.misses[e] |= bool(misses[k])
            choice = self._certain(shown)
            if choice is None and shown.rows == ENOUGH:
                choice = self._likely(node)
            if choice is not None:
                self._decide(node, choice, int(transfers[k]))
                return

    def _decide(self, node: int, choice: str, since: int) -> None:
        self._code[node], self._since[node], self._done[node] = self._number(choice), since, True
        del self._shown[node]

    def _spoken(
        self, evidence: Evidence, node: int, table: pa.RecordBatch, rows: Array, transfers: Array
    ) -> tuple[Array, Array]:
        """Return the rows that speak for an evidence, and those that speak against it."""
        hits, misses = np.zeros(len(rows), bool), np.zeros(len(rows), bool)
        if evidence.sends:
            for name in evidence.sends:
                hits |= self.sent[name][node] <= transfers
            return hits, misses
        column, of = table.column(evidence.field).take(pa.array(rows)), np.arange(len(rows))
        if pa.types.is_list(column.type):
            of = np.repeat(of, np.asarray(column.value_lengths().fill_null(0)))
            column = column.flatten()
        values = np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False))
        low, stop = self._limits(evidence)
        inside, good = (values >= low) & (values < stop), np.isfinite(values)
        hits[of[inside & good]] = True
        misses[of[~inside & good]] = True
        return hits, misses

    def _limits(self, evidence: Evidence) -> tuple[float, float]:
        """Return the limits in the unit of the column; they are given raw."""
        outer, _, last = evidence.field.rpartition(".")
        note, owner = self.message.notes.get(evidence.field), self.message.notes.get(outer)
        scales = [part.scale for part in (owner.parts if owner is not None else ()) if part.name == last]
        scale = (note.scale if note is not None else next(iter(scales), None)) or 1
        low = -np.inf if evidence.low is None else float(evidence.low * scale)
        return low, np.inf if evidence.stop is None else float(evidence.stop * scale)

    def _certain(self, shown: _Shown) -> str | None:
        """Return the choice that nothing can change any more."""
        possible: set[str] = set()
        for evidence, hit, miss in zip(self.reading.evidence, shown.hits, shown.misses, strict=True):
            if not evidence.every and hit:
                return evidence.choice if possible <= {evidence.choice} else None
            if not (evidence.every and miss):
                possible.add(evidence.choice)
        return None

    def _likely(self, node: int) -> str:
        """Return the choice as things stand, empty if there is none."""
        shown = self._shown.get(node)
        if shown is None:
            return self.reading.otherwise
        for evidence, hit, miss in zip(self.reading.evidence, shown.hits, shown.misses, strict=True):
            sent = any(self.sent[name][node] != _NEVER for name in evidence.sends)
            if (hit or sent) and not (evidence.every and miss):
                return evidence.choice
        return self.reading.otherwise

    def end(self, *, ahead: bool) -> None:
        """Decide every node that has shown something; rows that are out already stay as they are."""
        for node in list(self._shown):
            self._decide(node, self._likely(node), 0 if ahead else _NEVER)

    # ---- rows

    def codes(self, table: pa.RecordBatch, *, ahead: bool) -> tuple[Array, Array]:
        """Return the number of each row's choice, and whether that is decided."""
        nodes = senders(table)
        known = self._done[nodes] if ahead else numbers(table.column("transfer")) >= self._since[nodes]
        if known.all():
            return self._code[nodes], known
        return np.where(known, self._code[nodes], np.uint8(self._number(self.reading.otherwise))), known

    def named(self, code: Array) -> pa.Array:
        """Return choices by their numbers, null for none."""
        names = pa.array([None, *self.reading.choices], pa.string())
        return names.take(pa.array(code))

    def followed(self, column: Derived, code: Array, table: pa.RecordBatch) -> pa.Array:
        """Return a column that follows the reading; rows without one stay."""
        adds = np.array([np.nan, *(float(column.by_choice.get(one, np.nan)) for one in self.reading.choices)])[code]
        plain = table.column(column.name)
        by_reading = linear(numbers(table.column(column.source)), column.scale, column.offset) + adds
        values = np.where(np.isnan(adds), numbers(plain), by_reading)
        return pa.array(values, mask=~valid(plain)) if plain.null_count else pa.array(values)

    def statements(self) -> Iterator[Statement]:
        """Yield one for each node that has sent a good transfer."""
        reading = self.reading
        for code in np.flatnonzero(self._seen).tolist():
            bus, node = code >> 8, code & 0xFF
            if self._wanted(node) is not None:
                choice = f"{self._wanted(node)}{FORCED}"
            elif self._done[code]:
                choice = ("", *reading.choices)[self._code[code]]
            else:
                choice = self._likely(code)
            yield Statement(self.message.name, reading.name, reading.field, bus, node, choice or UNDECIDED)
