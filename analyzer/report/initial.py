"""A vehicle file made from a healthy capture, to be completed by whoever knows the vehicle."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.facts.names import short

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.facts.summary import NodeFacts
    from analyzer.report.build import Taken
    from analyzer.report.model import Capture, NodeUse
    from dissectors import Registry

_FEWEST = 8  # transfers that show a rate
_THROUGHOUT = 0.9  # of the capture, for a type that is sent all the time
_SECOND = 1_000_000_000


def vehicle_file(taken: Taken, capture: Capture, registry: Registry, bit_rate: int | None) -> str:
    """TOML that `analyzer.rules.expected` reads; texts of the capture are escaped."""
    return "\n".join(_lines(taken, capture, registry, bit_rate)) + "\n"


def _lines(taken: Taken, capture: Capture, registry: Registry, bit_rate: int | None) -> Iterator[str]:
    facts = taken.checked.outcome.facts
    yield f"# Made from {_quoted(capture.path)}; sha256 {_quoted(capture.sha256)}."
    yield "# Rates are met within 10 percent: delete those of types that are not sent all the time."
    if bit_rate is not None:
        yield f"bit_rate = {bit_rate}"
    if escs := int(facts.get("escs", 0)):
        yield f"escs = {escs}"
    done: set[int] = set()
    for node in capture.nodes:
        if node.node >= 1 and node.node not in done:
            done.add(node.node)
            yield from _node(node, taken, registry)
    units = {int(name[5:]): int(node) for name, node in facts.items() if name.startswith("unit ")}
    if units:
        yield from ("", "[unit]", *(f"0x{unit:02X} = {node}" for unit, node in sorted(units.items())))


def _node(node: NodeUse, taken: Taken, registry: Registry) -> Iterator[str]:
    facts = taken.checked.facts
    span = (facts.end or 0) - (facts.start or 0)
    sent = [one for one in facts.nodes if (one.bus, one.node) == (node.bus, node.node)]
    steady = {one.sends: one.hz for one in sent if one.hz is not None and _steady(one, span, registry)}
    names = [short(name) for name in steady]
    yield from ("", f"[node.{node.node}]")
    if label := node.label or node.name:
        yield f"label = {_quoted(label)}"
    if steady:
        keys = [short(name) if names.count(short(name)) == 1 else name for name in steady]
        pairs = [f"{_quoted(key)} = {_rate(hz)}" for key, hz in zip(keys, steady.values(), strict=True)]
        yield f"rates = {{ {', '.join(pairs)} }}"


def _steady(one: NodeFacts, span: int, registry: Registry) -> bool:
    """Whether a message comes throughout the capture; what carries packets is sent as it is needed."""
    if one.kind != "message" or not one.known or one.count < _FEWEST or not one.hz:
        return False
    carriers = {message.name for message in registry.carriers()}
    return one.sends not in carriers and one.count * _SECOND / one.hz >= _THROUGHOUT * span


def _rate(hz: float) -> str:
    """Three digits, without an exponent."""
    return f"{float(f'{hz:.3g}'):.6f}".rstrip("0").rstrip(".")


def _quoted(text: str) -> str:
    """A basic string of TOML on one line; nothing in it reaches a terminal as a control character."""
    shown = (f"\\{c}" if c in '"\\' else c if c.isprintable() else f"\\U{ord(c):08X}" for c in text)
    return f'"{"".join(shown)}"'
