"""The statistics that there are: what each is for, and how one is made of `NAME[,ARGUMENT...]`."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from analyzer.filter.matcher import Matcher
    from analyzer.sources.dataflash import AutopilotLog
    from analyzer.stats.statistic import Statistic
    from dissectors import Registry

# Names, and what each tells. Nothing heavy is imported for them.
STATISTICS = {
    "io": "io[,INTERVAL[,FILTER...]]: frames, bytes, load per interval (1 s)",
    "hierarchy": "frames and bytes by bus, protocol, kind and type",
    "nodes": "who sends: role, ESC, firmware, rate, lost, bad, restarts",
    "talkers": "who sends how much of what",
    "services": "requests and responses: unanswered ones, and how long answers take",
    "periods": "how evenly each node sends each type",
    "load": "how busy each bus is, the worst second, and who causes it",
    "values": "values,FIELD: how the values of a field are spread, per ESC",
    "findings": "what check finds, a row a rule",
    "flights": "when motors turned, and how each flight ended",
    "events": "what happened: faults, modes, silences, restarts, gaps",
    "odd": "which ESC differs from its own past, or from the others",
}
# Where each stands; it is imported when it is asked for, from a room above if it needs one.
_HOMES = {
    "io": "analyzer.stats.io:IntervalTable",
    "hierarchy": "analyzer.stats.hierarchy:Hierarchy",
    "nodes": "analyzer.flight.odd.table:MarkedNodeTable",
    "talkers": "analyzer.stats.talkers:TalkerTable",
    "services": "analyzer.stats.services:ServiceTable",
    "periods": "analyzer.stats.periods:PeriodTable",
    "load": "analyzer.stats.load:LoadTable",
    "values": "analyzer.stats.values:ValueTable",
    "findings": "analyzer.stats.findings:FindingTable",
    "flights": "analyzer.flight.flight_table:FlightTable",
    "events": "analyzer.flight.event_table:FlightEventTable",
    "odd": "analyzer.flight.odd.table:OddTable",
}
# What other programs call them.
_ELSEWHERE = {
    "conv": "talkers", "endpoints": "nodes", "hosts": "nodes", "phs": "hierarchy", "srt": "services", "rtd": "services",
    "jitter": "periods", "busload": "load", "rates": "periods",
}  # fmt: skip
_ALIASES = {"expert": "findings"}
_BRACKETS = {"(": 1, "{": 1, "[": 1, ")": -1, "}": -1, "]": -1}


def named(text: str) -> tuple[str, list[str]]:
    """Return name and arguments of `NAME[,ARGUMENT...]`. Raises `ValueError` for a name that no statistic has.

    A comma in brackets or quotes belongs to an argument.
    """
    name, *arguments = _split(text)
    name = name.strip()
    name = _ALIASES.get(name, name)
    if name not in STATISTICS:
        from difflib import get_close_matches  # noqa: PLC0415 - only mistakes need it

        if meant := _ELSEWHERE.get(name):
            raise ValueError(f"{text[:40]!r} is what others call it; did you mean {meant}?")
        meant = next(iter(get_close_matches(name[:40], STATISTICS, n=1)), "")
        hint = f"; did you mean {meant}?" if meant else ""
        raise ValueError(f"no statistic is called {name[:40]!r}{hint} (one of: {', '.join(STATISTICS)})")
    if name == "io" and arguments[:1] in (["phs"], ["stat"]):
        meant = "hierarchy" if arguments[0] == "phs" else ",".join(["io", *arguments[1:]])
        raise ValueError(f"{text[:40]!r} is what others call it; did you mean {meant}?")
    takes = {"io": None, "values": 1}.get(name, 0)
    if takes is not None and len(arguments) != takes:
        if takes and arguments:
            raise ValueError(
                f"values takes one field: {' '.join(f'-z values,{one.strip()}' for one in arguments)[:80]}"
            )
        raise ValueError("values needs a field: values,FIELD" if takes else f"{name} takes no arguments")
    return name, arguments


def statistics(
    texts: Sequence[str],
    registry: Registry,
    bit_rate: int,
    matcher: Callable[[str], Matcher],
    *,
    filtered: bool,
    autopilot: AutopilotLog | None = None,
) -> list[Statistic]:
    """Return the statistics that are asked for.

    Args:
        texts: `NAME[,ARGUMENT...]` of each.
        registry: the types.
        bit_rate: of the bus, in bits a second.
        matcher: makes a filter, joined with that of the command, work on the capture.
        filtered: there is a filter of the command.
        autopilot: the autopilot's own log.

    Raises `ValueError` for what makes no sense (`FilterError` is one).
    """
    from analyzer.stats.order import StatOrder  # noqa: PLC0415 - the names alone cost nothing

    traffic = import_module("analyzer.stats.traffic").SenderTraffic(registry)
    made: list[Statistic] = []
    for text in texts:
        name, arguments = named(text)
        module, _, kind = _HOMES[name].partition(":")
        order = StatOrder(arguments, registry, bit_rate, matcher, traffic, filtered, autopilot)
        made.append(getattr(import_module(module), kind)(order))
    return made


def _split(text: str) -> Iterator[str]:
    depth, quoted, start, skip = 0, False, 0, False
    for at, c in enumerate(text):
        if skip:
            skip = False
        elif quoted and c == "\\":
            skip = True
        elif c == '"':
            quoted = not quoted
        elif not quoted:
            depth += _BRACKETS.get(c, 0)
            if c == "," and depth <= 0:
                yield text[start:at]
                start = at + 1
    yield text[start:]
