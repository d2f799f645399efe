"""The nodes of a capture, a row each, and the types that they send."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, NamedTuple

from analyzer.facts.names import short
from analyzer.views.info.stay import StayFormat
from analyzer.views.terminal import display_width, escape, fit, fit_name

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.facts.senders import SenderFacts
    from analyzer.facts.summary import Facts, NodeFacts

_ROWS = 40
_BUS, _ROLE, _NAME, _SENDS = 16, 20, 40, 40  # columns at most
_INDENT = " " * 5


class _Column(NamedTuple):
    """Texts below a title; numbers stand to the right."""

    title: str
    texts: list[str]
    right: bool = False

    @property
    def width(self) -> int:
        return max(map(display_width, (self.title, *self.texts)))

    def cell(self, text: str) -> str:
        blank = " " * (self.width - display_width(text))
        return blank + text if self.right else text + blank


def senders(facts: Facts, width: int, *, everything: bool) -> Iterator[str]:
    """Write a row for each node; what does not fit into `width` columns stands below."""
    if not facts.senders:
        yield "No DroneCAN transfers."
        return
    stays = _stays(facts)
    shown, more = _most_telling(facts.senders, everything)
    columns = [*_places(facts, [(one.bus, _number(one.node, anonymous=one.anonymous)) for one in shown])]
    columns += [
        _Column("Ch", [_channels(one.channels) for one in shown], right=True),
        _Column("Role", [_role(one) for one in shown]),
        _Column("Hz", [_rate(one.hz) for one in shown], right=True),
        _Column("Bad", [str(one.bad) for one in shown], right=True),
        _Column("Lost", ["-" if one.lost is None else str(one.lost) for one in shown], right=True),
        _Column("Restart", ["-" if one.restarts is None else str(one.restarts) for one in shown], right=True),
        _Column("Seen", [stays.stay(one.first, one.last) for one in shown]),
    ]
    at = len(columns) - 5
    software = _Column("Software", [escape(one.software or "-") for one in shown])
    if _together([*columns, software]) <= width:
        columns.insert(at, software)
    odd = _Column("Odd", [", ".join(one.odd) for one in shown])
    names = _Column("Name", [fit(escape(one.name or "-"), _NAME) for one in shown])
    if any(one.name for one in shown) and _together([*columns, names, odd]) <= width:
        columns.insert(at, names)
    beside = any(odd.texts) and _together([*columns, odd]) <= width
    yield from _table([*columns, odd] if beside else columns, width, None if beside else odd.texts)
    if more:
        yield more
    if facts.not_listed:
        yield f"and {facts.not_listed} transfers of further nodes and types"
    if software not in columns:
        yield from _versions(facts, shown, width)


def types(facts: Facts, width: int, *, everything: bool) -> Iterator[str]:
    """Write a row for each type that a node sends, those without a definition too."""
    stays = _stays(facts)
    shown = facts.nodes if everything else facts.nodes[:_ROWS]
    numbers = (_number(one.node, anonymous=not one.node and one.kind != "message") for one in shown)
    columns = [
        *_places(facts, list(zip((one.bus for one in shown), numbers, strict=True))),
        _Column("Ch", [_channels(one.channels) for one in shown], right=True),
        _Column("Sends", [fit(_sends(one), _SENDS) for one in shown]),
        _Column("Count", [str(one.count) for one in shown], right=True),
        _Column("Hz", [_rate(one.hz) for one in shown], right=True),
        _Column("Bad", [str(one.bad) for one in shown], right=True),
        _Column("First", [stays.moment(one.first) for one in shown]),
        _Column("Last", [stays.moment(one.last) for one in shown]),
    ]
    yield from _table(columns, width)
    if len(facts.nodes) > len(shown):
        yield f"and {len(facts.nodes) - len(shown)} more (--all)"


def _most_telling(senders_: Sequence[SenderFacts], everything: bool) -> tuple[list[SenderFacts], str]:
    """Return the nodes to show, odd ones before others if there are too many, and a line about the others."""
    if everything or len(senders_) <= _ROWS:
        return list(senders_), ""
    ranked = sorted(range(len(senders_)), key=lambda k: (not senders_[k].odd, k))
    left = [senders_[k] for k in ranked[_ROWS:]]
    odd = sum(bool(one.odd) for one in left)
    return [senders_[k] for k in sorted(ranked[:_ROWS])], f"and {len(left)} more, {odd or 'none'} of them odd (--all)"


def _table(columns: Sequence[_Column], width: int, below: Sequence[str] | None = None) -> Iterator[str]:
    """Write the columns side by side, and a text `below` a row where there is one."""
    yield fit("  ".join(column.cell(column.title) for column in columns).rstrip(), width)
    for k in range(len(columns[0].texts)):
        yield fit("  ".join(column.cell(column.texts[k]) for column in columns).rstrip(), width)
        if below and below[k]:
            yield fit(f"{_INDENT}odd: {below[k]}", width)


def _versions(facts: Facts, shown: Sequence[SenderFacts], width: int) -> Iterator[str]:
    """Write who runs which software, for tables that have no room for it."""
    found: dict[str, list[str]] = {}
    for one in shown:
        if one.software:
            where = f"{escape(one.bus)}:" if len(facts.buses) > 1 else ""
            found.setdefault(escape(one.software), []).append(f"{where}{one.node}")
    for version, who in found.items():
        text = f"Software {version}: node{'s' if len(who) > 1 else ''} {', '.join(who)}"
        yield from textwrap.wrap(text, width, subsequent_indent=_INDENT, break_on_hyphens=False)


def _together(columns: Sequence[_Column]) -> int:
    return sum(column.width for column in columns) + 2 * (len(columns) - 1)


def _places(facts: Facts, at: Sequence[tuple[str, str]]) -> Iterator[_Column]:
    if len(facts.buses) > 1:
        yield _Column("Bus", [fit_name(escape(bus), _BUS) for bus, _ in at])
    yield _Column("Node", [number for _, number in at], right=True)


def _number(node: int, *, anonymous: bool) -> str:
    """Return the node ID; only a message can come from 0 and not be anonymous."""
    return "anon" if anonymous else str(node)


def _role(one: SenderFacts) -> str:
    return fit(escape(", ".join(one.roles)), _ROLE) or ("-" if one.known else "unknown")


def _sends(node: NodeFacts) -> str:
    kinds = {"request": " request", "response": " response"}
    return escape(short(node.sends)) + (kinds.get(node.kind, "") if node.known else "")


def _channels(channels: Sequence[int]) -> str:
    if not channels:
        return "-"
    return str(channels[0]) if len(channels) == 1 else f"{len(channels)}x"


def _rate(hz: float | None) -> str:
    return "-" if hz is None else f"{hz:.1f}"


def _stays(facts: Facts) -> StayFormat:
    return StayFormat(facts.start, facts.end, facts.absolute, facts.judge["timing"] == "yes")
