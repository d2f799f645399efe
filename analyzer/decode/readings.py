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

from analyzer.decode.columns import NODES, senders
from analyzer.decode.told import NEVER, ByNode, Decided, Told
from dissectors.kit.cells import floats, numbers
from dissectors.kit.nested import inner

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    import pyarrow as pa

    from analyzer.decode.sent import SentMessages
    from dissectors.kit import Array
    from dissectors.schema import Evidence, Message, Reading

ENOUGH = 50  # good transfers of a node
UNDECIDED = "undecided"
FORCED = " (forced)"


class Statement(NamedTuple):
    """One node's reading of `field`: one of the choices, or "undecided"."""

    message: str
    reading: str
    field: str
    bus: int
    node: int
    choice: str


class Readings:
    """The readings of all nodes, taken in batch by batch.

    Args:
        messages: those with doubtful fields.
        forced: choices by node ID that stand against any evidence.
        ahead: rows wait for the end of their batch.
    """

    def __init__(self, messages: Iterable[Message], forced: Mapping[int, Collection[str]], *, ahead: bool) -> None:
        self._ahead = ahead
        self._sent: dict[str, ByNode] = {}  # message that is evidence -> from which transfer on a node has sent it
        self._courses: dict[str, list[_Course]] = {}
        for message in messages:
            names = [name for reading in message.readings for one in reading.evidence for name in one.sends]
            self._sent |= {name: ByNode() for name in names if name not in self._sent}
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

    def learn(self, sent: Mapping[str, SentMessages], *, last: bool) -> None:
        """Take in the messages of a batch; with the `last` one every node is decided."""
        for name in self._sent.keys() & sent.keys():
            since, some = self._sent[name], sent[name]
            if (since[some.nodes] == NEVER).any():
                since.lower(some.senders[some.trusted], some.transfers[some.trusted])
        for name, courses in self._courses.items():
            for course in courses:
                if name in sent:
                    course.learn(sent[name])
                if last:
                    course.end(ahead=self._ahead)

    def now(self, table: str) -> list[Told]:
        """Return the readings of a table as they are known by now."""
        courses = self._courses.get(table, ())
        return [Told(course.message, course.reading, course.decided(), self._ahead) for course in courses]

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
    sent: Mapping[str, ByNode]
    _decided: Decided = field(init=False, default_factory=Decided)
    _lent: bool = field(init=False, default=False)  # somebody keeps what is decided now
    _seen: Array = field(init=False)
    _shown: dict[int, _Shown] = field(init=False, default_factory=dict)
    _statements: Sequence[Statement] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        """Begin without evidence; what is forced is decided."""
        self._seen = np.zeros(NODES, bool)
        for node in self.forced:
            if (choice := self._wanted(node)) is not None:
                self._settle(np.arange(NODES) & 0xFF == node, choice, 0)

    def _wanted(self, node: int) -> str | None:
        return next((one for one in self.forced.get(node, ()) if one in self.reading.choices), None)

    def decided(self) -> Decided:
        """Return what is decided by now; that stays as it is."""
        self._lent = True
        return self._decided

    def _settle(self, nodes: Array | int, choice: str, since: int) -> None:
        if self._lent:
            self._decided, self._lent = self._decided.copy(), False
        number = self.reading.choices.index(choice) + 1 if choice else 0
        self._decided.code[nodes], self._decided.since[nodes], self._decided.done[nodes] = number, since, True

    @property
    def waiting(self) -> bool:
        """True if a node has shown something that does not decide it."""
        return bool(self._shown)

    def know(self, other: _Course) -> None:
        """Take over what another one has decided, but not who was seen."""
        self._decided, self._lent, self._statements = other._decided.copy(), False, None
        self._decided.since[self._decided.done] = 0

    # ---- evidence

    def learn(self, sent: SentMessages) -> None:
        """Take in the message, as far as it is from nodes that are not decided."""
        if not self._seen[sent.nodes].all():
            self._seen[sent.nodes], self._statements = True, None
        nodes = sent.nodes[~self._decided.done[sent.nodes]].tolist()
        if not nodes:
            return
        places = [np.flatnonzero(sent.trusted & (sent.senders == node))[: self._missing(node)] for node in nodes]
        table = sent.table(np.concatenate(places))
        spoken = [self._spoken(one, table) for one in self.reading.evidence]
        transfers, begin = numbers(table.column("transfer")), 0
        for node, some in zip(nodes, places, strict=True):
            rows = slice(begin, begin + len(some))
            self._look(node, transfers[rows], [(hits[rows], misses[rows]) for hits, misses in spoken])
            begin = rows.stop

    def _missing(self, node: int) -> int:
        """Return how many more rows of a node are looked at."""
        return ENOUGH - (self._shown[node].rows if node in self._shown else 0)

    def _look(self, node: int, transfers: Array, spoken: Sequence[tuple[Array, Array]]) -> None:
        """Add rows of one node until it is decided; `spoken` says which speak for and against each evidence."""
        count = len(self.reading.evidence)
        shown = self._shown.setdefault(node, _Shown([False] * count, [False] * count))
        for k in range(len(transfers)):
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
        self._settle(node, choice, since)
        del self._shown[node]

    def _spoken(self, evidence: Evidence, table: pa.RecordBatch) -> tuple[Array, Array]:
        """Return the rows that speak for an evidence, and those that speak against it."""
        hits, misses = np.zeros(len(table), bool), np.zeros(len(table), bool)
        if evidence.sends:
            nodes, transfers = senders(table), numbers(table.column("transfer"))
            for name in evidence.sends:
                hits |= self.sent[name][nodes] <= transfers
            return hits, misses
        rows, raw = inner(table.column(evidence.field), np.arange(len(table)), ())
        values = floats(raw)
        low, stop = self._limits(evidence)
        inside, good = (values >= low) & (values < stop), np.isfinite(values)
        hits[rows[inside & good]] = True
        misses[rows[~inside & good]] = True
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
            sent = any(self.sent[name][node] != NEVER for name in evidence.sends)
            if (hit or sent) and not (evidence.every and miss):
                return evidence.choice
        return self.reading.otherwise

    def end(self, *, ahead: bool) -> None:
        """Decide every node that has shown something; rows that are out already stay as they are."""
        for node in list(self._shown):
            self._decide(node, self._likely(node), 0 if ahead else NEVER)

    def statements(self) -> Sequence[Statement]:
        """Return one for each node that has sent a good transfer: the same ones as long as all are decided."""
        if self._statements is not None:
            return self._statements
        reading, decided, found = self.reading, True, []
        for code in np.flatnonzero(self._seen).tolist():
            bus, node = code >> 8, code & 0xFF
            if self._wanted(node) is not None:
                choice = f"{self._wanted(node)}{FORCED}"
            elif self._decided.done[code]:
                choice = ("", *reading.choices)[self._decided.code[code]]
            else:
                choice, decided = self._likely(code), False
            found.append(Statement(self.message.name, reading.name, reading.field, bus, node, choice or UNDECIDED))
        self._statements = found if decided else None
        return found
