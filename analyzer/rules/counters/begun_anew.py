"""Which counters that come to 0 belong to a node that restarted, and which only lost what is before that."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

from analyzer.rules.counters.id_patterns import UptimeWitness
from analyzer.rules.counters.id_steps import GAP, QUIET, REPEATED, RESTARTED

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

NEAR = 64  # steps of a node among which the other ones to 0 are looked for


class AtZero(NamedTuple):
    """A step to 0, a restart perhaps."""

    rule: str
    t: int
    since: int
    place: int


class BegunAnew:
    """The latest steps of a node to 0, and its uptimes."""

    def __init__(self) -> None:
        self.uptimes = UptimeWitness()
        self._latest: deque[AtZero] = deque(maxlen=NEAR)

    def add(self, one: AtZero) -> None:
        """Add a step."""
        self._latest.append(one)

    def told(self, anew: Sequence[AtZero]) -> Iterator[str]:
        """Yield the rules of steps, with restarts told from what looks like one.

        A restarted node begins all its sessions anew. One that was at 0 by chance did not stand still then, and one
        that comes to 0 without another witness has lost what is before that.
        """
        known = {one.place for one in anew if one.rule == RESTARTED}
        for one in anew:
            if self._is_lost(one, anew):
                yield GAP
            elif one.rule == REPEATED and one.place not in known:
                known.add(one.place)
                yield RESTARTED if self._began(one, anew) else one.rule
            else:
                yield one.rule

    def alone(self, one: AtZero) -> str:
        """Return the rule of one step like that."""
        return GAP if self._is_lost(one, self._latest) else one.rule

    def _is_lost(self, one: AtZero, anew: Iterable[AtZero]) -> bool:
        """Return whether the IDs before 0 were lost, rather than all that the node sends begun anew."""
        return one.rule == RESTARTED and not self._began(one, anew)

    def _began(self, one: AtZero, anew: Iterable[AtZero]) -> bool:
        """Return whether the uptime witnesses that, or the other sessions do and the uptime is no witness against."""
        began = self.uptimes.began(one.since, one.t)
        return _with_others(one, anew) if began is None else began


def _with_others(one: AtZero, anew: Iterable[AtZero]) -> bool:
    return any(
        abs(one.t - other.t) <= QUIET and other.place != one.place and RESTARTED in (one.rule, other.rule)
        for other in anew
    )
