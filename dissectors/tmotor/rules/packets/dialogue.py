"""PUSH-102, -103, -201 and -304: whether packets in PUSHSCI are answered by packets in PUSHCAN (4.4.4, 4.4.5).

An answer may come as long as its first frame is in time; a transfer that began then can end 2.0 s later, so that a
question is decided only after that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Rule, sound
from dissectors.records import dataclass, replace
from dissectors.tmotor.rules.packets.carried import (
    ALL_UNITS,
    FIRST_UNIT,
    LONGEST,
    NO_CHANGE_8,
    NO_CHANGE_16,
    carrier,
    occurrence,
    packet_tables,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, DecodedTable, Occurrence, View

_MOST = 16_384  # questions under way; an older one is forgotten
_ALL_INDEXES = 0xFF
# Name in a finding, column of the set packet, column of the feedback, what leaves it as it is.
_SHARED = (
    ("acceleration", "acceleration_limit", "acceleration_limit", NO_CHANGE_16),
    ("deceleration", "deceleration_limit", "deceleration_limit", NO_CHANGE_16),
    ("direction", "rotation_direction", "rotation_direction", NO_CHANGE_16),
    ("throttle priority", "throttle_priority.priority", "throttle_priority", NO_CHANGE_8),
    ("LED", "led", "led", NO_CHANGE_16),
    ("bus rate", "bus_rate", "bus_rate", NO_CHANGE_8),
    ("report rate", "report_rate", "report_rate", NO_CHANGE_16),
)


@dataclass(slots=True)
class _Question:
    """A packet that a unit should answer."""

    bus: int
    unit: int
    transfer: int
    found: Occurrence  # what is said without an answer
    wanted: dict[str, int]


class _Answers:
    """The packets of a batch that may answer, by bus and unit, in the order of their transfers."""

    def __init__(self, table: DecodedTable | None) -> None:
        self._table = table
        self._rows: dict[tuple[int, int], Array] = {}
        if table is not None:
            self._good = sound(table).nonzero()[0]
            self._keys = table.bus[self._good].astype(np.int64) << 8 | table["unit_id"][self._good]

    def first(self, question: _Question, limit: int) -> int | None:
        """Return the row of the first answer within `limit` ns."""
        table, key = self._table, (question.bus, question.unit)
        if table is None:
            return None
        if key not in self._rows:
            self._rows[key] = self._good[self._keys == (question.bus << 8 | question.unit)]
        rows, t = self._rows[key], question.found.t
        at = int(table["transfer"][rows].searchsorted(question.transfer, "right"))
        for row in rows[at:].tolist():
            if t <= table.t[row] <= t + limit:
                return int(row)
            if table.t[row] > t + limit:
                break
        return None


class _Waiting:
    """Questions of one kind that are not answered yet."""

    def __init__(self) -> None:
        """Begin without questions."""
        self._open: list[_Question] = []

    def ask(self, questions: Iterable[_Question]) -> None:
        """Add questions; those without a time are never asked."""
        self._open += [one for one in questions if one.found.t != NO_TIME]
        del self._open[:-_MOST]

    def answered(self, answers: _Answers, limit: int) -> Iterator[tuple[_Question, int]]:
        """Yield questions with the row of the first answer, which are then done."""
        left = []
        for one in self._open:
            row = answers.first(one, limit)
            if row is None:
                left.append(one)
            else:
                yield one, row
        self._open = left

    def expired(self, end: int, limit: int) -> list[_Question]:
        """Return questions that had `limit` ns before `end`, which are then done."""
        late = [one for one in self._open if one.found.t + limit <= end]
        self._open = [one for one in self._open if one.found.t + limit > end]
        return late


class _Dialogue(Rule):
    """Questions of one packet of PUSHSCI, answers of one of PUSHCAN."""

    asked = answered = setting = ""
    unit = SECOND

    def __init__(self) -> None:
        """Begin without a question."""
        self._waiting = _Waiting()

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield questions whose time is over."""
        limit = self._limit(view)
        table = view.table(self.asked)
        if table is not None:
            self._waiting.ask(self._questions(view, table))
        self._before(view)
        for _ in self._waiting.answered(_Answers(view.table(self.answered)), limit):
            pass
        for one in self._waiting.expired(view.end - LONGEST, limit) if view.end != NO_TIME else ():
            yield one.found

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield the rest, if the capture went on for long enough."""
        for one in self._waiting.expired(view.end, self._limit(view)):
            yield one.found

    def _limit(self, view: View) -> int:
        return round(view.number(self.rules[0], self.setting) * self.unit)

    def _units(self, _view: View, table: DecodedTable, row: int) -> Iterable[int]:
        return (int(table["unit_id"][row]),)

    def _before(self, _view: View) -> None:
        """Remember of a batch what questions of later ones need."""

    def _questions(self, view: View, table: DecodedTable) -> Iterator[_Question]:
        rule, limit = self.rules[0], view.number(self.rules[0], self.setting)
        name = "limit_ms" if self.unit == MILLISECOND else "limit_s"
        for row in sound(table).nonzero()[0].tolist():
            for unit in self._units(view, table, row):
                found = occurrence(view, table, row, rule, {"unit_id": unit, name: limit}, held=True)
                yield _Question(int(table.bus[row]), unit, int(table["transfer"][row]), found, {})


class Sets(_Dialogue):
    """FOC parameters that are set."""

    rules = ("PUSH-102",)
    asked, answered, setting = "PUSHSCI.FocParameters", "PUSHCAN.FocFeedback", "timeout_s"


class Controls(_Dialogue):
    """Control packets."""

    rules = ("PUSH-304",)
    asked, answered, setting = "PUSHSCI.OutputControl", "PUSHCAN.MotorStatus", "timeout_ms"
    unit = MILLISECOND


class Queries(_Dialogue):
    """Queries of one unit, or of all that were there shortly before."""

    rules = ("PUSH-201",)
    asked, answered, setting = "PUSHSCI.FocQuery", "PUSHCAN.FocFeedback", "timeout_s"

    def __init__(self) -> None:
        """Begin without a unit."""
        super().__init__()
        self._seen = np.full(1, NO_TIME)

    def _units(self, view: View, table: DecodedTable, row: int) -> Iterable[int]:
        if table["unit_id"][row] != ALL_UNITS:
            return super()._units(view, table, row)
        bus, t, transfer = int(table.bus[row]), int(table.t[row]), table["transfer"][row]
        since = t - round(view.number("PUSH-201", "seen_s") * SECOND)
        past = self._seen[bus << 8 : (bus + 1) << 8]
        units = set(((past != NO_TIME) & (past >= since)).nonzero()[0].tolist())
        for packets in _reports(view):
            here = sound(packets) & (packets.bus == bus) & (packets["transfer"] < transfer) & (packets.t >= since)
            units.update(np.unique(packets["unit_id"][here]).tolist())
        return sorted(units)

    def _before(self, view: View) -> None:
        for packets in _reports(view):
            good = sound(packets)
            keys = packets.bus[good].astype(np.int64) << 8 | packets["unit_id"][good]
            if keys.size:
                missing = ((int(keys.max()) >> 8) + 1 << 8) - len(self._seen)
                if missing > 0:
                    self._seen = np.append(self._seen, np.full(missing, NO_TIME))
                self._seen[keys] = np.maximum(self._seen[keys], packets.t[good])


class Feedback(Rule):
    """Compares what was set with what is fed back first, unless a ParamCfg to the same ESC came in between."""

    rules = ("PUSH-103",)

    def __init__(self) -> None:
        """Begin with nothing set."""
        self._waiting = _Waiting()
        self._configured: list[tuple[int, int, int]] = []  # transfer, bus, index

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield fields that differ."""
        window = round(view.number("PUSH-103", "window_s") * SECOND)
        self._note(view.table("ParamCfg"))
        table = view.table("PUSHSCI.FocParameters")
        if table is not None:
            self._waiting.ask(_settings(view, table))
        feedback = view.table("PUSHCAN.FocFeedback")
        if feedback is not None:
            for question, row in self._waiting.answered(_Answers(feedback), window):
                if not self._touched(question, int(feedback["transfer"][row])):
                    yield from _differing(view, feedback, row, question)
        if view.end != NO_TIME:
            self._waiting.expired(view.end - LONGEST, window)

    def _note(self, table: DecodedTable | None) -> None:
        if table is not None:
            rows = table.trusted.nonzero()[0]
            columns = (table["transfer"][rows], table.bus[rows], table["esc_index"][rows])
            self._configured += zip(*(column.tolist() for column in columns), strict=True)
            del self._configured[:-_MOST]

    def _touched(self, question: _Question, until: int) -> bool:
        indexes = (question.unit - FIRST_UNIT, _ALL_INDEXES)
        return any(
            question.transfer < transfer < until and bus == question.bus and index in indexes
            for transfer, bus, index in self._configured
        )


def _reports(view: View) -> Iterator[DecodedTable]:
    return (table for table in packet_tables(view) if carrier(table) == "PUSHCAN")


def _settings(view: View, table: DecodedTable) -> Iterator[_Question]:
    for row in sound(table).nonzero()[0].tolist():
        given = [(name, column) for name, column, _, ones in _SHARED if table[column][row] != ones]
        wanted = {name: int(table[column][row]) for name, column in given if table.has(column)[row]}
        found = occurrence(view, table, row, "PUSH-103", {})
        unit = int(table["unit_id"][row])
        yield _Question(int(table.bus[row]), unit, int(table["transfer"][row]), found, wanted)


def _differing(view: View, feedback: DecodedTable, row: int, question: _Question) -> Iterator[Occurrence]:
    for name, _, column, _ in _SHARED:
        value = int(feedback[column][row])
        if question.wanted.get(name, value) != value:
            values: dict[str, Any] = {"field": name, "expected": question.wanted[name], "value": value}
            found = occurrence(view, feedback, row, "PUSH-103", values)
            yield replace(found, frames=(*found.frames, *question.found.frames))
