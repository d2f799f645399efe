"""A transfer that did not arrive as it was sent, and what is said of it: alone, or of many together."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.facts.identifiers import NOBODY
from analyzer.rules.diagnosis import proofs
from analyzer.rules.diagnosis.neighbours import parts_of
from analyzer.rules.diagnosis.proofs import Cause
from analyzer.rules.frames.type_conflicts import types_of
from analyzer.rules.view import MESSAGE, node_of
from dissectors.kit import Occurrence, Occurrences

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from dissectors.kit import Values, View

SEQUENCE, CUT, LATE, CHECKSUM = "TRF-003", "TRF-006", "TRF-007", "TRF-010"
DROPS = {SEQUENCE, CUT, LATE}  # what frames that the recorder lost may explain, whatever the cause
SECONDS = 2.0  # where the core closes a transfer
BY_SEQUENCE = "broken sequence"


class Incomplete(NamedTuple):
    """A transfer, and the rule that it breaches."""

    rule: str
    t: int
    bus: int
    src: int
    code: int
    fd: bool
    frames: Sequence[int]
    wire: int
    here: int
    payload: bytes
    received: int
    end: int
    searched: bool = True
    ended: str = ""  # the rule that its missing end breaches, if another one says why

    @property
    def sender(self) -> tuple[int, int, int]:
        """Bus, node and type."""
        return self.bus, self.src, self.code

    @property
    def shape(self) -> tuple[int, int]:
        """Frames and bytes that came."""
        return len(self.frames), self.received


class Unsearched(NamedTuple):
    """An incomplete transfer whose cause was not searched, and what is said all the same."""

    transfer: Incomplete
    cause: Cause
    noted: bool
    drops: bool

    def alone(self, view: View) -> Occurrence:
        """Return it as an occurrence of its own."""
        found = occurrence(view, self.transfer, self.cause)
        return replace(found, severity="note" if self.noted else None, drops=self.drops)

    def with_end(self) -> Iterator[Unsearched]:
        """Yield it, and the end that a broken sequence takes with it."""
        yield self
        if self.transfer.rule == SEQUENCE and self.transfer.ended:
            yield self._replace(transfer=self.transfer._replace(rule=self.transfer.ended), cause=_FOLLOWS)


_FOLLOWS = Cause(BY_SEQUENCE, f" ({SEQUENCE})")


def occurrences_of(view: View, unsearched: Iterable[Unsearched]) -> Iterator[Occurrences]:
    """Put many of them together, so that nothing is looked up but for those that are shown."""
    groups: dict[tuple[str, bool, bool], list[Unsearched]] = {}
    for one in unsearched:
        groups.setdefault((one.transfer.rule, one.noted, one.drops), []).append(one)
    for (rule, noted, drops), rows in groups.items():
        yield _joined(view, rows, rule, noted=noted, drops=drops)


def _joined(view: View, rows: Sequence[Unsearched], rule: str, *, noted: bool, drops: bool) -> Occurrences:
    column = np.array(
        [(a.transfer.t, a.transfer.bus, a.transfer.src, a.transfer.code, a.transfer.frames[0]) for a in rows], np.int64
    ).T
    nobody = (column[2] == 0) & (column[3] >> 16 != MESSAGE)
    return Occurrences(
        rule=rule, t=column[0], bus=column[1], node=np.where(nobody, NOBODY, column[2]), type=column[3],
        frame=column[4], values=lambda k: values_of(view, rows[k].transfer, rows[k].cause),
        frames=lambda k: rows[k].transfer.frames, key=np.array([a.cause.what for a in rows]),
        severity="note" if noted else None, drops=drops,
    )  # fmt: skip


def take_row(view: View, rule: str, row: int) -> Incomplete:
    """Return the transfer in a row of this batch, as breach of a rule."""
    t = view.transfers
    who = int(t.t[row]), int(t.bus[row]), int(t.src[row]), int(t.code[row]), bool(t.fd[row])
    crc, end = bool(t.has("crc_wire")[row]), int(t.t_end[row])
    wire, here = (int(t.crc_wire[row]), int(t.crc_here[row])) if crc and rule == CHECKSUM else (0, 0)
    return Incomplete(rule, *who, t.frames(row), wire, here, t.payload(row), int(t.length[row]) + 2 * crc, end)


def with_end(view: View, one: Incomplete, found: Occurrence) -> Iterator[Occurrence]:
    """Yield a finding, and the end that a broken sequence takes with it."""
    yield found
    if one.rule == SEQUENCE and one.ended:
        yield replace(occurrence(view, one._replace(rule=one.ended), _FOLLOWS), severity=found.severity)


def occurrence(view: View, one: Incomplete, cause: Cause, further: Iterable[int] = ()) -> Occurrence:
    """Return a finding; `further` frames are evidence too."""
    frames = (*one.frames, *further)
    return Occurrence(
        rule=one.rule, t=one.t, bus=one.bus, node=node_of(one.src, one.code), type=view.type_name(one.code),
        frames=frames, drops=one.rule in DROPS, lines=view.lines(frames), values=values_of(view, one, cause),
    )  # fmt: skip


def values_of(view: View, one: Incomplete, cause: Cause) -> Values:
    """Return what the text of its rule is filled with."""
    why = {"cause": cause.what, "why": f": {cause.what}{cause.detail}"}
    if one.rule == SEQUENCE:
        parts = parts_of(view, one.frames)
        at = parts[proofs.break_at(parts)].number if parts else one.frames[0]
        return {"cause": cause.what, "detail": cause.detail, "frame": at + 1}
    if one.rule == CUT:
        return why | {"frames": len(one.frames), "bytes": one.received}
    if one.rule == LATE:
        return why | {"seconds": SECONDS}
    if one.rule == CHECKSUM:
        return why | {"crc_wire": one.wire, "crc_here": one.here}
    if one.rule == "TRF-011":
        return {"cause": cause.what, "detail": cause.detail}
    return types_of(view, one.code, cause.what)
