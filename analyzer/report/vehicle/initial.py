"""A vehicle file made from a healthy capture, to be completed by whoever knows the vehicle.

Any other capture of the same healthy vehicle has to pass it: it demands only what is sent throughout, at a steady pace.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.facts.names import short
from analyzer.rules.vehicle.expected import TOLERANCE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.facts.periods import Key, Pace
    from analyzer.facts.summary import NodeFacts
    from analyzer.report.draft import JudgedCapture
    from analyzer.report.model import CaptureSummary, NodeUse
    from dissectors import Registry

_NEAR = 0.1  # of the capture, as close to its end as a node of the vehicle is still heard

_EXAMPLES = """\

# What else can stand here:
#
# [rule.BUS-001]            # any rule: its severity, enabled = false, and the numbers of its page (tailbyte explain)
# severity = "error"        # error, warning or note
# limit_per_s = 2000
#
# [[waiver]]                # findings that somebody accepts until a day; repeatable
# rule = "TRF-016"
# node = 11                 # only of this node, may be left out; so may type = "NodeStatus"
# reason = "the logger drops frames while it rotates files"
# owner = "bench team"
# expires = 2027-01-31      # the last day that it counts
#
# [require]                 # what a capture has to show, else it is not judged (exit status 4)
# types = ["NodeStatus"]    # seen at least once
# rules = ["TRF-010"]       # exercised, and provable with this recording
# escs = 4                  # at least
# running_s = 30            # seconds with motors turning, at least
"""


def vehicle_file(
    taken: JudgedCapture,
    capture: CaptureSummary,
    registry: Registry,
    bit_rate: int | None,
    paces: Mapping[Key, Pace],
    warning: str = "",
) -> str:
    """Write TOML that `analyzer.rules.vehicle.expected` reads; texts of the capture are escaped.

    Args:
        taken: the capture that the vehicle is known from.
        capture: what the report says of it.
        registry: the types that it was decoded with.
        bit_rate: of the bus, if it is known.
        paces: how steadily each node sends each type.
        warning: why the capture is no good model, if it is none.
    """
    return "\n".join(_lines(taken, capture, registry, bit_rate, paces, warning)) + "\n" + _EXAMPLES


def _lines(
    taken: JudgedCapture,
    capture: CaptureSummary,
    registry: Registry,
    bit_rate: int | None,
    paces: Mapping[Key, Pace],
    warning: str,
) -> Iterator[str]:
    facts = taken.checked.outcome.facts
    yield f"# Made from {_quoted(capture.path)}; sha256 {_quoted(capture.sha256)}."
    if warning:
        yield f"# WARNING: {_quoted(warning)}"
    yield f"# Every node named here has to be there, every rate has to be met within {100 * TOLERANCE:.0f} percent."
    yield "# Listed are types that came throughout the capture, at a steady pace."
    yield "# bit_rate = 1000000" if bit_rate is None else f"bit_rate = {bit_rate}"
    if escs := int(facts.get("escs", 0)):
        yield f"escs = {escs}"
    done: set[int] = set()
    for node in capture.nodes:
        if node.node >= 1 and node.node not in done:
            done.add(node.node)
            yield from _node(node, taken, registry, paces)
    units = {int(name[5:]): int(node) for name, node in facts.items() if name.startswith("unit ")}
    if units:
        span = _span(taken)
        told = {
            node for (_, node, kind), pace in paces.items() if kind in _carriers(registry) and pace.throughout(span)
        }
        yield from ("", "[unit]  # power unit = node ID")
        yield from (
            f"{'' if node in told else '# not told all the time: '}0x{unit:02X} = {node}"
            for unit, node in sorted(units.items())
        )


def _node(node: NodeUse, taken: JudgedCapture, registry: Registry, paces: Mapping[Key, Pace]) -> Iterator[str]:
    facts, carriers = taken.checked.facts, _carriers(registry)
    bus = facts.bus_names.index(node.bus)
    sent = [one for one in facts.nodes if (one.bus, one.node) == (node.bus, node.node)]
    steady = {
        one.sends: one.hz
        for one in sent
        if one.hz
        and _steady(one, paces.get((bus, one.node, one.type_id)), _span(taken))
        and one.type_id not in carriers
    }
    late = (facts.end or 0) - max((one.last for one in sent if one.last is not None), default=0)
    mark = "# " if late > _NEAR * _span(taken) else ""
    yield ""
    if mark:
        yield "# Silent at the end of the capture:"
    yield f"{mark}[node.{node.node}]"
    if label := node.label or node.name:
        yield f"{mark}label = {_quoted(label)}"
    if steady:
        pairs = [f"{_quoted(_shortest(name, registry))} = {_rate(hz)}" for name, hz in steady.items()]
        yield f"{mark}rates = {{ {', '.join(pairs)} }}"


def _carriers(registry: Registry) -> set[int]:
    return {message.type_id for message in registry.carriers()}


def _shortest(name: str, registry: Registry) -> str:
    """Return the last word of a type's name if it means no other type."""
    try:
        return short(name) if registry.resolve(short(name)).name == name else name
    except LookupError:  # ambiguous
        return name


def _span(taken: JudgedCapture) -> int:
    facts = taken.checked.facts
    return (facts.end or 0) - (facts.start or 0)


def _steady(one: NodeFacts, pace: Pace | None, span: int) -> bool:
    """Return True if a message of a known type comes at one pace, throughout the capture."""
    return one.kind == "message" and one.known and pace is not None and pace.steady and pace.throughout(span)


def _rate(hz: float) -> str:
    """Write three digits, without an exponent."""
    return f"{float(f'{hz:.3g}'):.6f}".rstrip("0").rstrip(".")


def _quoted(text: str) -> str:
    """Write a basic string of TOML on one line; nothing in it reaches a terminal as a control character."""
    shown = (f"\\{c}" if c in '"\\' else c if c.isprintable() else f"\\U{ord(c):08X}" for c in text)
    return f'"{"".join(shown)}"'
