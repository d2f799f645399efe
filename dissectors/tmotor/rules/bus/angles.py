"""Two angles of one rotor: that of the encoder in the status word, and the position in packets."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, Rule, sender, sound
from dissectors.records import dataclass
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, esc_reports

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, DecodedTable, Occurrences, View

_CIRCLE = 360.0


@dataclass(frozen=True, slots=True, eq=False)
class _Angles:
    """Angles at rest, in order; the first one is the last of the batch before."""

    number: Array
    t: Array
    angle: Array

    def before(self, number: Array) -> tuple[Array, Array]:
        """Return time and angle of the last one before each transfer, `NO_TIME` without any."""
        k = np.searchsorted(self.number, number) - 1
        return np.where(k < 0, NO_TIME, self.t[k]), self.angle[k]


_NONE = _Angles(np.array([-1]), np.array([NO_TIME]), np.zeros(1))


class Angles(Rule):
    """Compares each report at rest with the last of the other kind. Nodes with several indexes are left out."""

    rules = ("BUS-032",)

    def __init__(self) -> None:
        self._last: dict[tuple[int, int], tuple[_Angles, _Angles]] = {}
        self._indexes: dict[tuple[int, int], int] = {}

    def feed(self, view: View) -> Iterable[Occurrences]:
        """Join reports and packets of one node."""
        packets = view.table("PUSHCAN.MotorStatus")
        if view.start == NO_TIME:
            return
        every, resting = esc_reports(view), {}
        heard: set[tuple[int, int]] = set()
        if every is not None:
            rests = every.column("rpm") == 0
            for unit, part, any_rest in zip(every.escs, every.parts, every.any(rests), strict=True):
                who = unit.bus, unit.node
                if self._indexes.setdefault(who, unit.index) == unit.index:
                    heard.add(who)
                    if any_rest:
                        resting[who] = every.rows[part][rests[part]]
                else:
                    self._indexes[who] = -1
        still, node = np.empty(0, np.int64), np.empty(0, np.uint16)
        if packets is not None:
            still = np.flatnonzero(sound(packets) & (packets["speed"] == 0))
            node = sender(packets, still)
        talking = {(code >> 7, code & 0x7F) for code in np.flatnonzero(np.bincount(node)).tolist()}
        for who in sorted(talking | heard):
            if self._indexes.get(who) != -1 and (who in self._last or len(self._last) < MOST_UNITS):
                self._last.setdefault(who, (_NONE, _NONE))
                if who in talking or who in resting:
                    mine = still[node == (who[0] << 7 | who[1])]
                    yield from self._compare(view, who, resting.get(who), (packets, mine))

    def _compare(
        self, view: View, who: tuple[int, int], reports: Array | None, what: tuple[DecodedTable | None, Array]
    ) -> Iterator[Occurrences]:
        packets, rows = what
        table, last = view.table("ESCStatus"), self._last[who]
        encoder = _taken(last[0], table, reports, "error_count.encoder")
        position = _taken(last[1], packets, rows, "position")
        self._last[who] = _tail(encoder), _tail(position)
        if table is not None and reports is not None:
            yield from _apart(view, (table, reports), (encoder, position), encoder_first=True)
        if packets is not None:
            yield from _apart(view, (packets, rows), (position, encoder), encoder_first=False)


def _taken(last: _Angles, table: DecodedTable | None, rows: Array | None, column: str) -> _Angles:
    if table is None or rows is None or not len(rows):
        return last
    return _Angles(
        np.concatenate((last.number, table["transfer"][rows].astype(np.int64))),
        np.concatenate((last.t, table.t[rows])),
        np.concatenate((last.angle, table[column][rows])),
    )


def _tail(angles: _Angles) -> _Angles:
    return _Angles(angles.number[-1:], angles.t[-1:], angles.angle[-1:])


def _apart(
    view: View, what: tuple[DecodedTable, Array], both: tuple[_Angles, _Angles], *, encoder_first: bool
) -> Iterator[Occurrences]:
    """Yield rows of one kind whose angle differs from the last of the other kind."""
    (table, rows), (own, other) = what, both
    if not len(rows):
        return
    angle, t = own.angle[-len(rows) :], own.t[-len(rows) :]
    other_t, other_angle = other.before(own.number[-len(rows) :])
    off = np.abs((angle - other_angle + _CIRCLE / 2) % _CIRCLE - _CIRCLE / 2)
    near = (other_t != NO_TIME) & (t - np.maximum(other_t, 0) <= view.number("BUS-032", "window_ms") * MILLISECOND)
    at = np.flatnonzero(near & (off > view.number("BUS-032", "tolerance_deg")))
    if len(at):
        angles = zip(angle[at].tolist(), other_angle[at].tolist(), strict=True)
        pairs = dict(zip(rows[at].tolist(), angles, strict=True))

        def values(row: int) -> dict[str, float]:
            mine, its = pairs[row]
            return {"encoder": mine, "position": its} if encoder_first else {"encoder": its, "position": mine}

        yield view.among_rows("BUS-032", table, rows[at], values, dialects={"dronecan": None})
