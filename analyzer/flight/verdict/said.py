"""Evidence from an autopilot's own words, by the entries of `said.toml`."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

from analyzer.flight.thresholds import lasting
from dissectors.records import dataclass, field
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analyzer.flight.log import FlightEvent
    from analyzer.flight.verdict.model import Verdict

FILE = Path(__file__).with_name("said.toml")
_MOTOR = re.compile(r"\((\d+)\)")
_LASTING = frozenset({"autopilot error", "low battery"})  # go on until somebody says that they are over


class Onset(NamedTuple):
    """When something broke: the recorded times of the last good report and of the first bad one."""

    low: int
    high: int


@dataclass(frozen=True, slots=True)
class SaidEntry:
    """A word and what it speaks for and against, as `said.toml` explains its keys."""

    why: str
    type: str
    when: Literal["before", "with"]
    values: Mapping[str, Sequence[float]] = field(default_factory=dict)
    says: Sequence[str] = ()
    ch: bool = False
    role: str = ""
    for_: Sequence[str] = ()
    against: Sequence[str] = ()

    def holds(self, one: FlightEvent, verdict: Verdict, role: str, onset: Onset) -> bool:
        """Return whether an event is such a word, and about what a verdict speaks of; `role` is that of its device."""
        if one.type != self.type or one.values.get("code", 1) == 0:
            return False
        if any(one.values.get(name) not in allowed for name, allowed in self.values.items()):
            return False
        if self.says and not one.text.rpartition("-> ")[2].startswith(tuple(self.says)):
            return False
        motor = _MOTOR.search(one.text)
        if self.ch and (motor is None or int(motor[1]) != verdict.ch):
            return False
        return self.role in role and self._in_time(one, onset)

    def _in_time(self, one: FlightEvent, onset: Onset) -> bool:
        began, last = (one.before or one.first).ran, one.first.ran
        if self.when == "with":
            return began <= onset.high + lasting("said_with") and last >= onset.low - lasting("said_with")
        open_ = one.kind in _LASTING and (one.after is None or one.after.ran >= onset.low - lasting("said_before"))
        return last <= onset.low and (open_ or last >= onset.low - lasting("said_before"))


@cache
def entries() -> Sequence[SaidEntry]:
    """Return all of them."""
    import tomllib  # noqa: PLC0415 - few captures have an autopilot's log beside them

    found = tomllib.loads(FILE.read_text(encoding="utf-8"))["entry"]
    return tuple(SaidEntry(for_=one.pop("for", ()), **one) for one in found)


def said_for(
    verdict: Verdict, role: str, onset: Onset, words: Sequence[FlightEvent]
) -> tuple[Sequence[str], Sequence[str]]:
    """Return what an autopilot's words say for a verdict and against it, each in a line."""
    sides: tuple[list[str], list[str]] = ([], [])
    for entry in entries():
        for kinds, lines in zip((entry.for_, entry.against), sides, strict=True):
            if verdict.kind in kinds:
                lines += [line for line in _lines(entry, verdict, role, onset, words) if line not in lines]
    return sides


def _lines(
    entry: SaidEntry, verdict: Verdict, role: str, onset: Onset, words: Sequence[FlightEvent]
) -> Iterator[str]:  # fmt: skip
    """Yield the first word of an entry that holds, and when it was said."""
    for one in words:
        if entry.holds(one, verdict, role, onset):
            apart = (onset.low - one.first.ran) / SECOND
            when = f"{apart:.1f} s before" if entry.when == "before" else "just then"
            yield f"autopilot, {when}: {one.text}"
            return
