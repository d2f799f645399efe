"""29-bit identifiers of other protocols. Whose a frame is may turn out up to 512 frames of its session later."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.decode.grouped import grouped
from analyzer.facts.identifiers import NOBODY
from analyzer.tables import EXTENDED, FRAME_ANOMALIES, VERDICTS
from dissectors.kit import Occurrence, Occurrences, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, Values, View

_FOREIGN = VERDICTS.index("foreign")
# Verdicts of frames without a source that have 2 bits of type; with any other one the type has 16.
_ANONYMOUS = (_FOREIGN, VERDICTS.index("no tail"), VERDICTS.index("anonymous multi"))
_IS_ANONYMOUS = np.array([verdict in _ANONYMOUS for verdict in range(len(VERDICTS))])
_CYPHAL = 1 << FRAME_ANOMALIES.index("cyphal")
PROBATION = 512  # frames of a session after which a verdict stands
MOST_HELD = 1 << 18  # frames that wait for their verdict, then the oldest are taken as they are
MOST_NAMED = 256  # identifiers with a finding of their own; all further ones share one
SHOWN = 20  # first frames of an identifier whose bytes are kept until its verdict stands
_OFTEN, _SOON = 1 << 14, MOST_HELD + MOST_HELD // 2  # that wait as it is looked whose verdict stands
_TOLD = 1 << 15  # frames that are told at once: whoever counts them makes columns of that length
# Commands in bits 15 to 8 of the identifiers of VESC motor controllers: set points, and what they report.
VESC = frozenset({0, 1, 2, 3, 4, 9, 14, 15, 16, 27, 28})
# Formats of addressed messages in SAE J1939-21: acknowledgement, request, transport, address claim, proprietary.
J1939_ADDRESSED = frozenset({0xE8, 0xEA, 0xEB, 0xEC, 0xEE, 0xEF})
J1939_BROADCAST = 0xF0


class _Rows(NamedTuple):
    """Frames: number, time, bus, identifier."""

    number: Array
    t: Array
    bus: Array
    id: Array

    def at(self, rows: Array | slice) -> _Rows:
        return _Rows(*(column[rows] for column in self))

    @property
    def identifier(self) -> Array:
        """Those of different buses are different."""
        return self.bus.astype(np.int64) << 32 | self.id

    @property
    def session(self) -> Array:
        return self.bus.astype(np.int64) << 32 | session_bits(self.id, np.array(_FOREIGN))


class Foreign(Rule):
    """One finding an identifier and bus, each of its frames an occurrence."""

    rules = ("CAN-018",)

    def __init__(self) -> None:
        self._held: list[_Rows] = []
        self._waiting = 0
        self._again = _OFTEN
        self._cleared: list[int] = []
        self._marked: list[int] = []
        self._cyphal: set[int] = set()
        self._seen: dict[int, int] = {}
        self._lines: dict[int, tuple[str, ...]] = {}
        self._named: set[int] = set()
        self._further: int | None = None

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield frames whose verdict cannot change any more."""
        self._correct(view)
        f = view.frames
        if f.verdict.any():
            rows = np.flatnonzero((f.verdict == _FOREIGN) & (f.flags & EXTENDED != 0))
            self._hold(view, _Rows(rows + f.first, f.t[rows], f.bus[rows], f.id[rows]))
            self._marked += (rows[f.anomaly[rows] & _CYPHAL != 0] + f.first).tolist()
        if self._waiting >= self._again:
            yield from self._release(PROBATION)
            self._again = min(max(_OFTEN, 2 * self._waiting), _SOON)

    def finish(self, _view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield the rest."""
        yield from self._release(0)

    def _correct(self, view: View) -> None:
        """Correct frames of earlier batches that are foreign after all, or are not."""
        one = view.settled
        if not len(one.number):
            return
        self._marked += one.number[one.anomaly & _CYPHAL != 0].tolist()
        self._cleared += one.number[one.verdict != _FOREIGN].tolist()
        late = one.of(np.flatnonzero((one.verdict == _FOREIGN) & one.known & (one.flags & EXTENDED != 0)))
        cells = view.frames
        bus, id_ = late.bus.astype(cells.bus.dtype), late.id.astype(cells.id.dtype)  # those of all that are held
        self._hold(view, _Rows(late.number, late.t, bus, id_))

    def _hold(self, view: View, rows: _Rows) -> None:
        if not len(rows.number):
            return
        self._held.append(rows)
        self._waiting += len(rows.number)
        identifier = rows.identifier
        opened = np.array(self._opened(identifier), np.int64)
        mine = np.isin(identifier, opened).nonzero()[0] if len(opened) else opened
        if not len(mine):
            return
        order, begins = grouped(identifier[mine])
        some = []
        for low, high in zip(begins.tolist(), [*begins[1:].tolist(), len(order)], strict=True):
            key = identifier.item(mine.item(order.item(low)))
            seen = self._seen.get(key, 0)
            some.append(mine[order[low : min(high, low + SHOWN - seen)]])
            self._seen[key] = seen + len(some[-1])
        numbers = rows.number[np.concatenate(some)]
        lines = view.each_line(numbers).tolist()
        self._lines |= {number: (line,) if line else () for number, line in zip(numbers.tolist(), lines, strict=True)}

    def _opened(self, identifier: Array) -> list[int]:
        """Return which of these identifiers may have more frames whose bytes are kept."""
        known = self._seen
        if len(known) < MOST_NAMED:
            came: list[int] = np.unique(identifier).tolist()
            new = [key for key in came if key not in known][: MOST_NAMED - len(known)]
            return [*new, *(key for key in came if known.get(key, SHOWN) < SHOWN)]
        waiting = [key for key, seen in known.items() if seen < SHOWN]
        if not waiting:
            return waiting
        keys = np.array(waiting, np.int64)
        found: list[int] = keys[np.isin(keys, identifier)].tolist()
        return found

    def _release(self, patience: int) -> Iterator[Occurrences | Occurrence]:
        """Yield of each session all but the last `patience` frames."""
        if not self._held:
            return
        columns = _columns(self._held)
        places = self._standing(columns[0])
        if places is not None:
            _pick(columns, places)
        del places  # they are large
        rows = _Rows(*columns)
        if self._marked:
            self._cyphal.update(rows.at(_places(rows.number, self._marked)).session.tolist())
        self._cleared, self._marked = [], []
        if patience:
            done = _waited(rows, patience)
            del rows
            kept = _Rows(*_split(columns, done))
            self._held = [kept]
            rows = _Rows(*columns)
            del done
        del columns
        self._waiting = sum(len(kept.number) for kept in self._held)
        for start in range(0, len(rows.number), _TOLD):
            yield from self._found(rows.at(slice(start, start + _TOLD)))

    def _standing(self, number: Array) -> Array | None:
        """Return which frames are foreign, by their places in the order of numbers; None for all of them."""
        places, stays = None, np.ones(len(number), bool)
        if (number[1:] <= number[:-1]).any():  # some were foreign after all
            places = number.argsort(kind="stable")
            number = number[places]
            np.not_equal(number[1:], number[:-1], out=stays[1:])
        for gone in self._cleared:
            self._lines.pop(gone, None)
        if self._cleared:
            stays[_places(number, self._cleared)] = False
        if stays.all():
            return places
        del number  # it is large
        return stays.nonzero()[0] if places is None else places[stays]

    def _found(self, rows: _Rows) -> Iterator[Occurrences | Occurrence]:
        identifier = rows.identifier
        self._name(identifier)
        named = np.isin(identifier, np.array(sorted(self._named), np.int64))

        def values(row: int) -> Values:
            if not named[row]:
                return {
                    "can_id": (self._further or 0) & 0x1FFF_FFFF,
                    "protocol": f"the first of all identifiers beyond {MOST_NAMED} that are not DroneCAN",
                }
            can_id = int(rows.id[row])
            session = int(rows.bus[row]) << 32 | session_of(can_id, _FOREIGN)
            return {"can_id": can_id, "protocol": protocol(can_id, cyphal=session in self._cyphal)}

        shown = np.isin(rows.number, np.fromiter(self._lines, np.int64, len(self._lines)))
        for row in np.flatnonzero(shown).tolist():
            number = int(rows.number[row])
            lines = self._lines.pop(number)
            bus = int(rows.bus[row])
            yield Occurrence("CAN-018", int(rows.t[row]), bus, None, "", (number,), values(row), lines=lines)
        rest = np.flatnonzero(~shown)
        nobody = np.full(len(rest), NOBODY)
        yield Occurrences(
            rule="CAN-018", t=rows.t[rest], bus=rows.bus[rest], node=nobody, type=nobody, frame=rows.number[rest],
            values=lambda k: values(int(rest[k])), frames=lambda k: (int(rows.number[rest[k]]),),
            key=np.where(named[rest], identifier[rest], NOBODY),
        )  # fmt: skip

    def _name(self, identifier: Array) -> None:
        """Give identifiers findings of their own in the order in which they came, as long as there are some."""
        if self._further is not None:
            return
        keys, at = np.unique(identifier, return_index=True)
        for key in keys[np.argsort(at)].tolist():
            if len(self._named) < MOST_NAMED:
                self._named.add(key)
            elif key not in self._named:
                self._further = key
                return


def _columns(parts: list[_Rows]) -> list[Array]:
    """Return the columns of frames that are held in parts, which are gone: both at once are large."""
    columns = [*zip(*parts, strict=True)]
    parts.clear()
    columns.reverse()
    return [np.concatenate(columns.pop()) for _ in _Rows._fields]


def _pick(columns: list[Array], places: Array) -> None:
    """Leave nothing but some places in columns, in one after the other."""
    for k, column in enumerate(columns):
        columns[k] = column[places]


def _split(columns: list[Array], mask: Array) -> Iterator[Array]:
    """Leave what a mask has in columns, one after the other; yield what else was in each."""
    for k, column in enumerate(columns):
        others = column[~mask]
        columns[k] = column[mask]
        yield others


def _places(number: Array, some: list[int]) -> Array:
    """Return where some numbers stand among others in order, of those that do."""
    wanted = np.array(some, np.int64)
    if not len(number):
        return wanted[:0]
    at = np.minimum(number.searchsorted(wanted), len(number) - 1)
    found: Array = at[number[at] == wanted]
    return found


def session_bits(identifier: Array, verdict: Array) -> Array:
    """Return what the identifiers of one session have in common: all but the priority, and a discriminator."""
    number = identifier.astype(np.int64)
    anonymous = (number & 0xFF == 0) & _IS_ANONYMOUS[verdict]
    return np.where(anonymous, number & 0x300, number & 0xFF_FFFF)


def session_of(identifier: int, verdict: int) -> int:
    """Return the same of one frame."""
    return identifier & (0x300 if identifier & 0xFF == 0 and verdict in _ANONYMOUS else 0xFF_FFFF)


def protocol(identifier: int, *, cyphal: bool) -> str:
    """Return whose identifier it is, as far as it shows."""
    if cyphal and _cyphal_form(identifier):
        return "Cyphal/CAN: its toggles start at 1"
    if identifier >> 14 == 0 and identifier >> 8 in VESC:
        return f"not DroneCAN, perhaps VESC: command {identifier >> 8}"
    form = identifier >> 16 & 0xFF
    if identifier >> 24 & 3 == 0 and (form >= J1939_BROADCAST or form in J1939_ADDRESSED):
        group = identifier >> 8 & (0xFFFF if form >= J1939_BROADCAST else 0xFF00)
        return f"not DroneCAN, perhaps J1939: PGN {group}"
    return "not DroneCAN"


def _cyphal_form(identifier: int) -> bool:
    """Return whether the reserved bits are those of a message or service of Cyphal/CAN, not of J1939 ending in FF."""
    message = identifier >> 21 & 7 == 3 and identifier >> 7 & 1 == 0
    return message or (identifier >> 25 & 1 == 1 and identifier >> 23 & 1 == 0)


def _waited(rows: _Rows, patience: int) -> Array:
    """Return which frames wait no longer: all but the last `patience` of each session, and the oldest ones."""
    over = max(0, len(rows.number) - MOST_HELD)
    done = np.ones(len(rows.number), bool)
    done[over:] = _from_end(rows.bus[over:].astype(np.uint32) << 24 | rows.id[over:] & 0xFF_FFFF) >= patience
    return done


def _from_end(keys: Array) -> Array:
    """Return how many later entries have the same key."""
    if not len(keys):
        return keys
    order, begins = grouped(keys)
    ends = np.append(begins[1:], len(keys)).astype(np.int32)
    left = np.repeat(ends, ends - begins)
    left -= np.arange(1, len(keys) + 1, dtype=np.int32)
    after = np.empty(len(keys), np.int32)
    after[order] = left
    return after
