"""Steps of transfer IDs that are not 1, as the core measures them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from analyzer.rules.counters.misnumbered import meant
from analyzer.tables import KINDS, TRANSFER_ANOMALIES, TRANSFER_IDS
from dissectors.kit import MILLISECOND, NO_TIME, SECOND, all_resumed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.rules.counters.orphan_frames import OrphanFrames
    from dissectors.kit import Array, TransferTable, Values, View

MESSAGE, REQUEST = KINDS.index("message"), KINDS.index("request")
QUIET = 2 * SECOND  # after it any transfer ID may follow (4.1.3)
LATE = 5 * SECOND  # a transfer can come out 2.0 s after its start; then nothing follows within `QUIET` any more
GAP, COPIED, REPEATED, RESTARTED = RULES = ("TRF-016", "TRF-017", "TRF-018", "TRF-019")
IS_GAP, IS_COPY, IS_REPEATED, IS_RESTART = range(4)  # places among these
_NAMES = ("transfer id gap", "duplicate", "transfer id repeated", "transfer id restarted")
_BITS = np.array([1 << TRANSFER_ANOMALIES.index(name) for name in _NAMES], np.int64)
_ORDER = np.argsort(_BITS)  # of several that a transfer has, the lowest bit says what it is
WITHOUT_START = "frames came without a start"
_SERVICE = 0x80  # bit of an identifier


class IdStep(NamedTuple):
    """One step that is not 1, of transfers with these frames.

    `code` is the type for `View.type_name`, `place` the session: the identifier, and above 32 bits the bus. `since` is
    the time of the transfer before.
    """

    rule: str
    t: int
    since: int
    code: int
    place: int
    transfer_id: int
    before: int
    frames: Sequence[int]

    @property
    def of_message(self) -> bool:
        """Return whether it is no request."""
        return not self.place & _SERVICE


class MovedStep(NamedTuple):
    """A step of which only the order changed, as it is told; `noted` says that it proves little."""

    frames: Sequence[int]
    values: Values
    noted: bool


class IdSteps(NamedTuple):
    """Steps, a row each, in the order of their transfers; columns as in `IdStep`.

    `rule` is a place in `RULES`, `row` that of the transfer in its batch, `gap` the time since the transfer before.
    `late` is a step after more than `QUIET`, which proves nothing; `early` is one soon after the start of the capture.
    `astray` marks those whose missing IDs came without a start. `lead` and `last` are their first and last frames;
    `begin` says where the frames of each stand in `numbers`, `size` how many they are.
    """

    rule: Array
    late: Array
    early: Array
    astray: Array
    t: Array
    since: Array
    gap: Array
    code: Array
    place: Array
    transfer_id: Array
    before: Array
    row: Array
    lead: Array
    last: Array
    begin: Array
    size: Array
    numbers: Array

    def take(self, rows: Array) -> IdSteps:
        """Return some of them."""
        columns = {name: column[rows] for name, column in zip(self._fields[:-1], self, strict=False)}
        return self._replace(**columns)

    def compact(self) -> IdSteps:
        """Return them with no other frames than theirs."""
        begin = np.cumsum(self.size) - self.size
        places = np.repeat(self.begin - begin, self.size) + np.arange(int(self.size.sum()))
        return self._replace(begin=begin, numbers=self.numbers[places])

    def __add__(self, other: IdSteps) -> IdSteps:  # type: ignore[override]
        """Return these and others behind them."""
        columns = [np.concatenate(both) for both in zip(self, other, strict=True)]
        found = IdSteps(*columns)
        found.begin[len(self.t) :] += len(self.numbers)
        return found

    def frames(self, k: int) -> Sequence[int]:
        """Return the numbers of all frames of one."""
        begin = self.begin.item(k)
        found: list[int] = self.numbers[begin : begin + self.size.item(k)].tolist()
        return found

    def step(self, k: int) -> IdStep:
        """Return one."""
        return IdStep(
            RULES[self.rule.item(k)], self.t.item(k), self.since.item(k), self.code.item(k), self.place.item(k),
            self.transfer_id.item(k), self.before.item(k), self.frames(k),
        )  # fmt: skip

    def values(self, k: int) -> dict[str, Any]:
        """Return what the text of one says."""
        rule, transfer_id = self.rule.item(k), self.transfer_id.item(k)
        expected = (self.before.item(k) + 1) % TRANSFER_IDS
        found: dict[str, Any] = {"transfer_id": transfer_id, "expected": expected}
        if rule == IS_GAP:
            cause = WITHOUT_START if self.astray.item(k) else ""
            found |= {"lost": (transfer_id - expected) % TRANSFER_IDS, "cause": cause}
        elif rule == IS_COPY:
            found["milliseconds"] = self.gap.item(k) / MILLISECOND
        return found


def of_message(place: Array) -> Array:
    """Return which sessions are no requests."""
    found: Array = place & _SERVICE == 0
    return found


def odd_rows(t: TransferTable) -> Array:
    """Return rows of messages and requests whose step is there and is not 1."""
    rows: Array = np.flatnonzero(t.step != 1)
    if not len(rows):
        return rows
    kind = t.kind[rows]
    ours: Array = t.has("step")[rows] & ((kind == MESSAGE) | (kind == REQUEST))
    return np.extract(ours, rows)


def id_steps(view: View, rows: Array, orphans: OrphanFrames) -> IdSteps:
    """Return the breaches among odd rows: after a silence only a gap is one, and no copy without times."""
    t = view.transfers
    bits = t.anomaly[rows].astype(np.int64)
    rule = np.full(len(rows), IS_GAP)
    late = np.ones(len(rows), bool)
    for k in _ORDER[::-1].tolist():
        has = bits & _BITS[k] != 0
        rule[has] = k
        late &= ~has
    at, kind = t.t[rows], t.kind[rows]
    bus, src, type_id = (column[rows].astype(np.int64) for column in (t.bus, t.src, t.type_id))
    timed = at != NO_TIME
    gap = np.where(t.has("gap")[rows], t.gap[rows], 0)
    since = np.where(timed, at - gap, at)
    keep = timed | (rule != IS_COPY)
    keep &= ~timed | (since >= all_resumed(view, at))
    to = np.where(kind == REQUEST, t.dst[rows], 0).astype(np.int64)
    place = np.where(kind == MESSAGE, type_id << 8, type_id << 16 | 1 << 15 | to << 8 | _SERVICE) | src | bus << 32
    transfer_id = t.transfer_id[rows].astype(np.int64)
    before = (transfer_id - t.step[rows]) % TRANSFER_IDS
    lead = t.lead[rows]
    some = np.flatnonzero(keep)
    asked = place[some], since[some], at[some], lead[some], t.code[rows[some]]
    transfer_id[some], before[some] = _as_meant(view, orphans, asked, (transfer_id[some], before[some]))
    expected = (before + 1) % TRANSFER_IDS
    keep &= transfer_id != expected
    keep &= ~late | ((transfer_id != 0) & (transfer_id != before))
    astray = np.zeros(len(rows), bool)
    may = np.flatnonzero(keep & ((rule == IS_GAP) | (rule == IS_RESTART)))
    first, lost = expected[may], (transfer_id - expected)[may] % TRANSFER_IDS
    astray[may] = orphans.cover(place[may], since[may], lead[may], first, lost)
    starts = np.zeros(256, np.int64)
    for one, start in view.starts.items():
        starts[one] = start
    early = timed & (at - starts[bus] < QUIET)
    offsets, numbers = t.frame_lists
    begin, end = offsets[rows], offsets[rows + 1]
    steps = IdSteps(
        rule, late, early, astray, at, since, gap, t.code[rows], place, transfer_id, before, rows,
        lead, numbers[end - 1].astype(np.int64), begin, end - begin, numbers,
    )  # fmt: skip
    return steps.take(np.flatnonzero(keep))


def _as_meant(
    view: View, orphans: OrphanFrames, steps: tuple[Array, ...], ids: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return transfer IDs and those of the transfers before, with those put right that a first frame has wrong.

    Only where frames came astray since that one. `steps` are their sessions, the times of the transfers before, their
    own times, first frames and types.
    """
    place, since, at, lead, code = steps
    own, earlier = orphans.behind(place, at, lead), orphans.before(place, since, lead)
    right = [np.where(one < 0, wire, one) for one, wire in zip(meant(view, lead, code, own, earlier), ids, strict=True)]
    odd = right[0] != right[1]
    return np.where(odd, right[0], ids[0]), np.where(odd, right[1], ids[1])
