"""The odd ones of a capture, found when somebody asks: most who judge a capture never do."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from analyzer.flight.thresholds import lasting

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.flight.odd.judge import OddEsc, OddReport

_NEAR = 2  # slots, by which a change may seem to be earlier


class OddLater:
    """Finds them once.

    Args:
        find: after the last batch.
        began: recorded time at which what is told began, None if nothing is.
    """

    def __init__(self, find: Callable[[], OddReport], began: int | None = None) -> None:
        self._find, self._began = find, began

    @cached_property
    def report(self) -> OddReport:
        """The odd ones, and the compared quantities."""
        return self._find()

    @property
    def before(self) -> Sequence[OddEsc]:
        """Those that matter for an answer: all of them, or those that became so well before what is told began."""
        if self._began is None:
            return self.report.odd
        last = self._began - _NEAR * lasting("odd_slot")
        return [one for one in self.report.odd if not one.always and one.ran < last]
