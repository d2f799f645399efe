"""Steps of transfer IDs that are not 1, as the core measures them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.counters.misnumbered import meant
from analyzer.tables import KINDS, TRANSFER_ANOMALIES, TRANSFER_IDS
from dissectors.kit import NO_TIME, SECOND, all_resumed

if TYPE_CHECKING:
    from analyzer.rules.counters.orphan_frames import OrphanFrames
    from dissectors.kit import Array, TransferTable, View

MESSAGE, REQUEST = KINDS.index("message"), KINDS.index("request")
QUIET = 2 * SECOND  # after it any transfer ID may follow (4.1.3)
GAP, COPIED, REPEATED, RESTARTED = RULES = ("TRF-016", "TRF-017", "TRF-018", "TRF-019")
IS_GAP, IS_COPY, IS_REPEATED, IS_RESTART = range(4)  # places among these
_NAMES = ("transfer id gap", "duplicate", "transfer id repeated", "transfer id restarted")
_BITS = np.array([1 << TRANSFER_ANOMALIES.index(name) for name in _NAMES], np.int64)
_ORDER = np.argsort(_BITS)  # of several that a transfer has, the lowest bit says what it is
LATE, EARLY, ASTRAY = 1, 2, 4  # bits of a step's marks
WITHOUT_START = "frames came without a start"
_SERVICE = 0x80  # bit of an identifier


class IdSteps(NamedTuple):
    """Steps, a row each, in the order of their transfers.

    `sender` is the bus above the node ID, `rule` a place in `RULES`, `place` the session: the identifier, and above 32
    bits the bus. `since` is the time of the transfer before, `gap` that since then, `row` that of the transfer in its
    batch. Of the `marks`, `LATE` is of a step after more than `QUIET`, which proves nothing, `EARLY` of one soon after
    the start of the capture, `ASTRAY` of one whose missing IDs came without a start.
    """

    sender: Array
    rule: Array
    marks: Array
    t: Array
    since: Array
    gap: Array
    code: Array
    place: Array
    transfer_id: Array
    before: Array
    row: Array


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
    marks = late * LATE | early * EARLY | astray * ASTRAY
    sender = bus << 8 | src
    columns = (
        (sender, np.uint16), (rule, np.uint8), (marks, np.uint8), (at, np.int64), (since, np.int64), (gap, np.int64),
        (t.code[rows], np.int64), (place, np.int64), (transfer_id, np.uint8), (before, np.uint8), (rows, np.uint32),
    )  # fmt: skip
    return IdSteps(*(column[keep].astype(kind) for column, kind in columns))


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
