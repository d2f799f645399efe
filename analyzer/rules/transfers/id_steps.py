"""Steps of transfer IDs that are not 1, as the core measures them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from analyzer.rules.transfers.misnumbered import meant, meant_before
from analyzer.tables import KINDS, TRANSFER_ANOMALIES, TRANSFER_IDS
from dissectors.kit import MILLISECOND, NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.rules.transfers.orphan_frames import OrphanFrames
    from dissectors.kit import Array, Severity, TransferTable, Values, View

MESSAGE, REQUEST = KINDS.index("message"), KINDS.index("request")
QUIET = 2 * SECOND  # after it any transfer ID may follow (4.1.3)
GAP, COPIED, REPEATED, RESTARTED = "TRF-016", "TRF-017", "TRF-018", "TRF-019"
_RULES = {
    1 << TRANSFER_ANOMALIES.index("transfer id gap"): GAP,
    1 << TRANSFER_ANOMALIES.index("duplicate"): COPIED,
    1 << TRANSFER_ANOMALIES.index("transfer id repeated"): REPEATED,
    1 << TRANSFER_ANOMALIES.index("transfer id restarted"): RESTARTED,
}
_BITS = sum(_RULES)
WITHOUT_START = "frames came without a start"


class IdStep(NamedTuple):
    """One step that is not 1. `session` is (kind, type, destination), `code` the type for `View.type_name`.

    `late` is a step after more than `QUIET`, which proves nothing; `early` is one soon after the start of the capture.
    `since` is the time of the transfer before; `cause` is that of a gap. `place` is the bus above 32 bits of the
    identifier.
    """

    rule: str
    severity: Severity | None
    late: bool
    t: int
    code: int
    session: tuple[int, int, int]
    transfer_id: int
    before: int
    frames: Sequence[int]
    values: Values
    since: int
    early: bool
    place: int
    cause: str = ""

    @property
    def step(self) -> int:
        """Return how far it counted, 0 to 31."""
        return (self.transfer_id - self.before) % TRANSFER_IDS

    def as_gap(self) -> IdStep:
        """Return the step as a gap, if what looks like a restart is none."""
        values = {**self.values, "lost": (self.step - 1) % TRANSFER_IDS, "cause": self.cause}
        return self._replace(rule=GAP, values=values, severity="note" if self.early else None)

    @property
    def of_message(self) -> bool:
        """Return whether it is no request."""
        return self.session[0] == MESSAGE


def odd_rows(t: TransferTable) -> Array:
    """Return rows of messages and requests whose step is there and is not 1."""
    rows: Array = np.flatnonzero(t.step != 1)
    if not len(rows):
        return rows
    kind = t.kind[rows]
    ours: Array = t.has("step")[rows] & ((kind == MESSAGE) | (kind == REQUEST))
    return np.extract(ours, rows)


def id_step(view: View, row: int, orphans: OrphanFrames) -> IdStep | None:
    """Return the breach of a row, None if it is none: after a silence only a gap is, and no copy without times."""
    t = view.transfers
    bits = int(t.anomaly[row]) & _BITS
    rule = _RULES[bits & -bits] if bits else GAP
    at, kind, bus = int(t.t[row]), int(t.kind[row]), int(t.bus[row])
    late, timed = not bits, at != NO_TIME
    if rule == COPIED and not timed:
        return None
    past = at - int(t.gap[row]) if timed and t.has("gap")[row] else at
    if timed and past < view.resumed(at):
        return None
    to = int(t.dst[row]) if kind == REQUEST else -1
    bits_of = int(t.type_id[row]) << 8 if kind == MESSAGE else int(t.type_id[row]) << 16 | 1 << 15 | to << 8 | 0x80
    place = bus << 32 | bits_of | int(t.src[row])
    transfer_id, before = _as_meant(view, row, orphans, (place, past))
    expected = (before + 1) % TRANSFER_IDS
    if transfer_id == expected or (late and transfer_id in {0, before}):
        return None
    values: dict[str, Any] = {"transfer_id": transfer_id, "expected": expected}
    frames, lost, cause = t.frames(row), (transfer_id - expected) % TRANSFER_IDS, ""
    if rule in (GAP, RESTARTED):
        missing = ((expected + k) % TRANSFER_IDS for k in range(lost))
        cause = WITHOUT_START if orphans.hold(place, past, frames[0], missing) else ""
    if rule == GAP:
        values |= {"lost": lost, "cause": cause}
    elif rule == COPIED:
        values["milliseconds"] = int(t.gap[row]) / MILLISECOND
    early = timed and at - view.starts[bus] < QUIET
    return IdStep(
        rule, "note" if rule == GAP and (late or early) else None, late, at, int(t.code[row]),
        (kind, int(t.type_id[row]), to), transfer_id, before, frames, values, past, early, place, cause,
    )  # fmt: skip


def _as_meant(view: View, row: int, orphans: OrphanFrames, since: tuple[int, int]) -> tuple[int, int]:
    """Return the transfer ID of a row and that of the one before, with those put right that a first frame has wrong.

    Only where frames came astray since that one, whose place and time are given.
    """
    t, (place, past) = view.transfers, since
    transfer_id, code, lead = int(t.transfer_id[row]), int(t.code[row]), t.frames(row)[0]
    before = (transfer_id - int(t.step[row])) % TRANSFER_IDS
    own = meant(view, lead, code) if orphans.came(place, int(t.t[row]), lead, behind=True) else None
    earlier = meant_before(view, lead, code) if orphans.came(place, past, lead) else None
    right = transfer_id if own is None else own, before if earlier is None else earlier
    return (transfer_id, before) if right[0] == right[1] else right
