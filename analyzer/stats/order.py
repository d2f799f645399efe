"""The order for a statistic: its arguments, and what it may use."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.decode.by_name import find_table
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.filter.matcher import Matcher
    from analyzer.sources.dataflash import AutopilotLog
    from analyzer.stats.traffic import SenderTraffic
    from dissectors import Registry


@dataclass(frozen=True, slots=True)
class StatOrder:
    """The arguments of a statistic, and what it may use.

    `bit_rate` is in bits a second; `matcher` makes a filter, joined with that of the command, work on the capture;
    `traffic` is shared by all statistics of a reading; `filtered` says that the command has a filter. `autopilot` is
    the autopilot's own log of the flight, if there is one.
    """

    arguments: Sequence[str]
    registry: Registry
    bit_rate: int
    matcher: Callable[[str], Matcher]
    traffic: SenderTraffic
    filtered: bool
    autopilot: AutopilotLog | None = None


def is_type(text: str, registry: Registry) -> bool:
    """Return whether a text names a type or packet, not a field."""
    try:
        find_table(registry, text)
    except LookupError:
        return False
    return True
