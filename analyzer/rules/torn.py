"""A transfer that did not arrive as it was sent, and what is said of it: alone, or of many together."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules import diagnosis
from analyzer.rules.diagnosis import Cause
from analyzer.rules.surroundings import parts_of
from dissectors.conformance import Found, Occurrence

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from dissectors.conformance import Values, View

SEQUENCE, CUT, LATE, CHECKSUM = "TRF-003", "TRF-006", "TRF-007", "TRF-010"
DROPS = {SEQUENCE, CUT, LATE}  # what frames that the recorder lost may explain, whatever the cause
SECONDS = 2.0  # where the core closes a transfer
BY_SEQUENCE = "broken sequence"
_PREFERRED = 0xFF_FFFF  # bits of a type's code: all but the variant
_NOBODY = -1


class Torn(NamedTuple):
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
    sought: bool = True
    ended: str = ""  # the rule that its missing end breaches, if another one says why

    @property
    def sender(self) -> tuple[int, int, int]:
        """Bus, node and type."""
        return self.bus, self.src, self.code

    @property
    def shape(self) -> tuple[int, int]:
        """Frames and bytes that came."""
        return len(self.frames), self.received


class Aside(NamedTuple):
    """One that nothing was searched for, and what is said of it all the same."""

    torn: Torn
    cause: Cause
    noted: bool
    drops: bool

    def alone(self, view: View) -> Occurrence:
        """It as a finding of its own."""
        found = occurrence(view, self.torn, self.cause)
        return replace(found, severity="note" if self.noted else None, drops=self.drops)

    def with_end(self) -> Iterator[Aside]:
        """It, and the end that a broken sequence takes with it."""
        yield self
        if self.torn.rule == SEQUENCE and self.torn.ended:
            yield self._replace(torn=self.torn._replace(rule=self.torn.ended), cause=_FOLLOWS)


_FOLLOWS = Cause(BY_SEQUENCE, f" ({SEQUENCE})")


def together(view: View, aside: Iterable[Aside]) -> Iterator[Found]:
    """Many of them at once, so that nothing is looked up but for those that are shown."""
    groups: dict[tuple[str, bool, bool], list[Aside]] = {}
    for one in aside:
        groups.setdefault((one.torn.rule, one.noted, one.drops), []).append(one)
    for (rule, noted, drops), rows in groups.items():
        yield _found(view, rows, rule, noted=noted, drops=drops)


def _found(view: View, rows: Sequence[Aside], rule: str, *, noted: bool, drops: bool) -> Found:
    column = np.array([(a.torn.t, a.torn.bus, a.torn.src, a.torn.code, a.torn.frames[0]) for a in rows], np.int64).T
    return Found(
        rule=rule, t=column[0], bus=column[1], node=np.where(column[2] == 0, _NOBODY, column[2]), type=column[3],
        frame=column[4], values=lambda k: values_of(view, rows[k].torn, rows[k].cause),
        frames=lambda k: rows[k].torn.frames, key=np.array([a.cause.what for a in rows]),
        severity="note" if noted else None, drops=drops,
    )  # fmt: skip


def torn(view: View, rule: str, row: int) -> Torn:
    """The transfer in a row of this batch, as breach of a rule."""
    t = view.transfers
    who = int(t.t[row]), int(t.bus[row]), int(t.src[row]), int(t.code[row]), bool(t.fd[row])
    crc, end = bool(t.has("crc_wire")[row]), int(t.t_end[row])
    wire, here = (int(t.crc_wire[row]), int(t.crc_here[row])) if crc and rule == CHECKSUM else (0, 0)
    return Torn(rule, *who, t.frames(row), wire, here, t.payload(row), int(t.length[row]) + 2 * crc, end)


def said(view: View, one: Torn, found: Occurrence) -> Iterator[Occurrence]:
    """A finding, and the end that a broken sequence takes with it."""
    yield found
    if one.rule == SEQUENCE and one.ended:
        yield replace(occurrence(view, one._replace(rule=one.ended), _FOLLOWS), severity=found.severity)


def occurrence(view: View, one: Torn, cause: Cause, further: Iterable[int] = ()) -> Occurrence:
    """A finding; `further` frames are evidence too."""
    frames = (*one.frames, *further)
    return Occurrence(
        rule=one.rule, t=one.t, bus=one.bus, node=one.src or None, type=view.type_name(one.code),
        frames=frames, drops=one.rule in DROPS, lines=view.lines(frames), values=values_of(view, one, cause),
    )  # fmt: skip


def values_of(view: View, one: Torn, cause: Cause) -> Values:
    """What the text of its rule is filled with."""
    why = {"cause": cause.what, "why": f": {cause.what}{cause.detail}"}
    if one.rule == SEQUENCE:
        parts = parts_of(view, one.frames)
        at = parts[diagnosis.break_at(parts)].number if parts else one.frames[0]
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


def types_of(view: View, code: int, name: str) -> Values:
    """What is said of a type that its CRC gives another name."""
    return {"type_id": code & 0xFFFF, "name": name, "expected": view.type_name(code & _PREFERRED)}
