"""Which differences fail: weights and kinds, as somebody names them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.report.comparison.model import KINDS, WEIGHTS
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analyzer.report.comparison.model import Difference

ANY, NEVER = "any", "never"
CHOICES = (ANY, *WEIGHTS, *KINDS, NEVER)


@dataclass(frozen=True, slots=True)
class DiffGate:
    """Fails on what is named: `any`, a weight and what is worse than that, kinds; nothing by default."""

    names: tuple[str, ...] = ()

    @classmethod
    def parse(cls, texts: Iterable[str]) -> DiffGate:
        """Read comma-separated names. Raises `ValueError`, for texts without a name too."""
        texts = tuple(texts)
        names = tuple(word for text in texts for word in (part.strip().lower() for part in text.split(",")) if word)
        for text in texts:
            if not text.strip(", \t"):
                raise ValueError(f"--fail-on {text!r} names nothing: {', '.join(CHOICES)}")
        for name in names:
            if name not in CHOICES:
                raise ValueError(f"--fail-on {name!r} is none of: {', '.join(CHOICES)}")
        if NEVER in names and len(names) > 1:
            raise ValueError(f"--fail-on {NEVER} goes with nothing else")
        return cls(() if NEVER in names else names)

    def fails(self, one: Difference) -> bool:
        """Return whether a difference fails."""
        worse = WEIGHTS[WEIGHTS.index(one.weight) :]
        return ANY in self.names or one.kind in self.names or any(name in worse for name in self.names)
