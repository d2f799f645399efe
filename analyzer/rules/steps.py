"""Steps of transfer IDs that are not 1, as the core measures them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from analyzer.rules.sequences import IDS
from analyzer.tables import KINDS, TRANSFER_ANOMALIES
from dissectors.conformance import MILLISECOND, NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.rules.headless import Headless
    from dissectors.conformance import Severity, Transfers, Values, View, Words

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
BEHEADED = "frames came without a start"


class Breach(NamedTuple):
    """One step that is not 1. `session` is (kind, type, destination), `code` the type for `View.type_name`.

    `late` is a step after more than `QUIET`, which proves nothing; `early` is one soon after the start of the capture.
    `since` is the time of the transfer before; `cause` is that of a gap.
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
    cause: str = ""

    @property
    def step(self) -> int:
        """How far it counted, 0 to 31."""
        return (self.transfer_id - self.before) % IDS

    def as_gap(self) -> Breach:
        """The same, if what looks like a restart is none."""
        values = {**self.values, "lost": (self.step - 1) % IDS, "cause": self.cause}
        return self._replace(rule=GAP, values=values, severity="note" if self.early else None)

    @property
    def of_message(self) -> bool:
        """Whether it is no request."""
        return self.session[0] == MESSAGE


def odd_rows(t: Transfers) -> Words:
    """Rows of messages and requests whose step is there and is not 1."""
    rows: Words = np.flatnonzero(t.step != 1)
    if not len(rows):
        return rows
    kind = t.kind[rows]
    ours: Words = t.has("step")[rows] & ((kind == MESSAGE) | (kind == REQUEST))
    return np.extract(ours, rows)


def breach(view: View, row: int, headless: Headless) -> Breach | None:
    """The breach of a row, None if it is none: after a silence only a gap is, and no copy without times."""
    t = view.transfers
    bits = int(t.anomaly[row]) & _BITS
    rule = _RULES[bits & -bits] if bits else GAP
    transfer_id, step, at, kind = int(t.transfer_id[row]), int(t.step[row]), int(t.t[row]), int(t.kind[row])
    late = not bits
    if (late and (not step or not transfer_id)) or (rule == COPIED and at == NO_TIME):
        return None
    before, bus = (transfer_id - step) % IDS, int(t.bus[row])
    expected = (before + 1) % IDS
    past = at - int(t.gap[row]) if at != NO_TIME and t.has("gap")[row] else at
    if at != NO_TIME and past < view.resumed(at):
        return None
    early = at != NO_TIME and at - view.starts[bus] < QUIET
    values: dict[str, Any] = {"transfer_id": transfer_id, "expected": expected}
    to, lost, cause = int(t.dst[row]) if kind == REQUEST else -1, (step - 1) % IDS, ""
    if rule in (GAP, RESTARTED):
        missing = ((expected + k) % IDS for k in range(lost))
        bits_of = int(t.type_id[row]) << 8 if kind == MESSAGE else int(t.type_id[row]) << 16 | 1 << 15 | to << 8 | 0x80
        session = bus << 32 | bits_of | int(t.src[row])
        cause = BEHEADED if headless.hold(session, past, t.frames(row)[0], missing) else ""
    if rule == GAP:
        values |= {"lost": lost, "cause": cause}
    elif rule == COPIED:
        values["milliseconds"] = int(t.gap[row]) / MILLISECOND
    return Breach(
        rule, "note" if rule == GAP and (late or early) else None, late, at, int(t.code[row]),
        (kind, int(t.type_id[row]), to), transfer_id, before, t.frames(row), values, past, early, cause,
    )  # fmt: skip
