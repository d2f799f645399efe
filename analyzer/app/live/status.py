"""The progress of a live session, in a line now and then, and at its end."""

from __future__ import annotations

import time
from collections import Counter
from typing import TYPE_CHECKING

from analyzer.board.latches import PROGRESS
from analyzer.report import wording
from analyzer.report.model import SEVERITIES
from dissectors.kit import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

    from analyzer.app.live.session import LiveSession
    from analyzer.live.interfaces.hub import InterfaceCounts
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Measured

# Seconds of a day, after which there is a line in any case.
DAY = 86_400.0
_NAMED = 3


class Status:
    """Says every so often what has happened since the last time.

    Args:
        every: seconds.
        tell: takes the line.
        recording: says in words what is being recorded; empty if nothing is.
        span: the time since the last line, in words.
        now: seconds of a monotonic clock.
    """

    def __init__(
        self,
        every: float,
        tell: Callable[..., None],
        recording: Callable[[], str],
        now: Callable[[], float] = time.monotonic,
        span: str = "since the last line",
    ) -> None:
        self.failed = False
        self._span = span
        self._every, self._tell, self._recording, self._now = every, tell, recording, now
        self._start = self._last = now()
        self._frames = self._dropped = 0
        self._new: Counter[tuple[str, str]] = Counter()

    def batch(self, measured: Measured) -> None:
        """Do nothing."""

    def found(self, changes: Sequence[Change]) -> None:
        """Count what is new."""
        self._new.update((one.finding.severity, one.finding.rule) for one in changes if one.fresh)

    def note(self, text: str) -> None:
        """Do nothing."""

    def look(self, session: LiveSession) -> None:
        """Say it when it is time."""
        if self._now() - self._last >= self._every:
            self._tell(self.line(session.loop.frames, session.loop.hub.counts))

    def line(self, frames: int, counts: Mapping[str, InterfaceCounts]) -> str:
        """Say what has happened since the last line; counts of all that was received and lost since the start."""
        now, dropped = self._now(), sum(one.dropped + one.lost for one in counts.values())
        span = max(now - self._last, 1e-9)
        came = frames - self._frames
        words = [
            f"{came:,} frames ({came / span:,.0f}/s)",
            f"{dropped - self._dropped:,} dropped",
            "; ".join(_new(self._new)) or "no new findings",
            self._recording(),
        ]
        running = wording.length(round((now - self._start) * SECOND))
        self._last, self._frames, self._dropped = now, frames, dropped
        self._new.clear()
        return f"{PROGRESS}{running}; {self._span}: {', '.join(filter(None, words))}"


def _new(found: Counter[tuple[str, str]]) -> Iterator[str]:
    for severity in SEVERITIES:
        rules = Counter({rule: count for (kind, rule), count in found.items() if kind == severity})
        if rules:
            names = [rule for rule, _ in rules.most_common(_NAMED)]
            more = ", ..." if len(rules) > _NAMED else ""
            yield f"{wording.plural(rules.total(), f'new {severity}')} ({', '.join(names)}{more})"


def account(counts: Mapping[str, InterfaceCounts], counted: Collection[str]) -> Iterator[str]:
    """Give the sums at the end, a line an interface; of those that are `counted` the kernel tells every drop."""
    for name, one in counts.items():
        total = one.received + one.dropped + one.lost
        lost = f" + {one.lost:,} lost here" if one.lost else ""
        told = "" if name in counted else ", as far as its driver tells"
        errors = f"; {wording.plural(one.errors, 'error frame')} received" if one.errors else ""
        sums = f"{one.received:,} received + {one.dropped:,} dropped{lost}{told}{errors}"
        yield f"{wording.safe(name)}: {total:,} frames = {sums}"
