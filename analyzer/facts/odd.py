"""How a node differs from the others of its role, in words."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from dissectors.records import replace
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer.facts.senders import SenderFacts

ENOUGH = 3  # of the same role: fewer do not tell which of them is the odd one
RATE = 0.2  # of the median: healthy devices lie closer, and one type more or less shows
STEADY = 10  # transfers that make a rate
LATE = 2 * SECOND  # behind the median start, or before the median end


def compared(senders: Iterable[SenderFacts]) -> tuple[SenderFacts, ...]:
    """Return the senders with what is odd about each: those of one bus and role are compared, if they are enough."""
    all_ = tuple(senders)
    groups: dict[tuple[str, tuple[str, ...]], list[SenderFacts]] = {}
    for one in all_:
        if one.roles:
            groups.setdefault((one.bus, one.roles), []).append(one)
    spoken = Counter((one.bus, channel) for one in all_ for channel in one.channels)
    found = []
    for one in all_:
        group = groups.get((one.bus, one.roles), ())
        odd = list(_differences(one, group)) if len(group) >= ENOUGH else []
        if any(spoken[one.bus, channel] > 1 for channel in one.channels):
            odd.append("channel shared")
        found.append(replace(one, odd=tuple(odd)))
    return tuple(found)


def _differences(one: SenderFacts, group: Sequence[SenderFacts]) -> Iterator[str]:
    from statistics import median  # noqa: PLC0415 - few buses have three of a role

    versions = Counter(member.software for member in group if member.software)
    usual = versions.most_common(1)[0][0] if versions else ""
    alike = sum(count for version, count in versions.items() if _same(version, usual))
    if one.software and alike * 2 > versions.total() and not _same(one.software, usual):
        yield "software"
    rates = [member.hz for member in group if member.hz is not None and member.count >= STEADY]
    if one.hz is not None and one.count >= STEADY and len(rates) >= ENOUGH:
        middle = median(rates)
        if abs(one.hz - middle) > RATE * middle:
            yield "rate"
    for word in ("bad", "lost", "restarts"):
        if (getattr(one, word) or 0) > 2 * median(getattr(member, word) or 0 for member in group):
            yield word
    began = [member.first for member in group if member.first is not None]
    ended = [member.last for member in group if member.last is not None]
    if one.first is not None and one.first - median(began) > LATE:
        yield "came late"
    if one.last is not None and median(ended) - one.last > LATE:
        yield "left early"


def _same(one: str, other: str) -> bool:
    """Return whether two versions may be one: some nodes answer `2.2` to those who ask, and tell `V2.2.0` in full."""
    return one in other or other in one
