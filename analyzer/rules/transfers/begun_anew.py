"""Which counters that come to 0 belong to a node that restarted, and which only lost what is before that."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from analyzer.rules.transfers.id_patterns import Uptimes
from analyzer.rules.transfers.id_steps import QUIET, REPEATED, RESTARTED

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer.rules.transfers.id_steps import IdStep

NEAR = 64  # steps of a node among which the other ones to 0 are looked for


class BegunAnew:
    """The latest steps of a node to 0, and its uptimes."""

    def __init__(self) -> None:
        self.uptimes = Uptimes()
        self._latest: deque[IdStep] = deque(maxlen=NEAR)

    def add(self, one: IdStep) -> None:
        """Add a step."""
        if _at_zero(one):
            self._latest.append(one)

    def told(self, held: Sequence[IdStep]) -> Iterator[IdStep]:
        """Yield the steps, with restarts told from what looks like one.

        A restarted node begins all its sessions anew. One that was at 0 by chance did not stand still then, and one
        that comes to 0 without another witness has lost what is before that.
        """
        anew = [one for one in held if _at_zero(one)]
        known = {one.session for one in anew if one.rule == RESTARTED}
        for one in held:
            if self._is_lost(one, anew):
                yield one.as_gap()
            elif one.rule == REPEATED and not one.transfer_id and one.session not in known:
                known.add(one.session)
                yield one._replace(rule=RESTARTED) if self._began(one, anew) else one
            else:
                yield one

    def alone(self, one: IdStep) -> IdStep:
        """Return one step like that."""
        return one.as_gap() if self._is_lost(one, self._latest) else one

    def _is_lost(self, one: IdStep, anew: Iterable[IdStep]) -> bool:
        """Return whether the IDs before 0 were lost, rather than all that the node sends begun anew."""
        return one.rule == RESTARTED and not self._began(one, anew)

    def _began(self, one: IdStep, anew: Iterable[IdStep]) -> bool:
        """Return whether the uptime witnesses that, or the other sessions do and the uptime is no witness against."""
        began = self.uptimes.began(one.since, one.t)
        return _with_others(one, anew) if began is None else began


def _at_zero(one: IdStep) -> bool:
    return one.rule == RESTARTED or (one.rule == REPEATED and not one.transfer_id)


def _with_others(one: IdStep, anew: Iterable[IdStep]) -> bool:
    return any(
        abs(one.t - other.t) <= QUIET and other.session != one.session and RESTARTED in (one.rule, other.rule)
        for other in anew
    )
