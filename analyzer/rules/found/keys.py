"""The key of a finding: what keeps it apart from others."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from dissectors.kit import Severity

FURTHER = "further"


class RuleAt(NamedTuple):
    """One rule at one node; `node` is -1 for none."""

    rule: str
    bus: int
    node: int


class Spot(NamedTuple):
    """One rule at one node, for one type; empty for none."""

    rule: str
    bus: int
    node: int
    type: str

    @property
    def where(self) -> RuleAt:
        """The rule and the node."""
        return RuleAt(self.rule, self.bus, self.node)


class FindingKey(NamedTuple):
    """The key that keeps findings apart. `node` is -1 and `type` empty for none."""

    rule: str
    severity: Severity
    bus: int
    node: int
    type: str
    key: str
    dialects: tuple[tuple[str, Severity | None], ...]

    @property
    def spot(self) -> Spot:
        """The spot that it belongs to."""
        return Spot(self.rule, self.bus, self.node, self.type)
