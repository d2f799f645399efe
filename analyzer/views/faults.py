"""Every fault and scenario that a simulation can be asked for, as text of 80 columns."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.traffic import Fault, Scenario, Setting

_WIDTH = 80


def render(faults: Iterable[Fault], scenarios: Iterable[Scenario], common: Iterable[str]) -> str:
    """Write the whole list; settings with their defaults stand below the fault that takes them."""
    return "".join(f"{line}\n" for line in _lines(tuple(faults), tuple(scenarios), tuple(common)))


def _lines(faults: tuple[Fault, ...], scenarios: tuple[Scenario, ...], common: tuple[str, ...]) -> Iterator[str]:
    yield "Faults: --fault RULE[@TIME][:key=value...], --fault-rate RULE=P"
    others = ", ".join(f"{name}=" for name in common)
    yield from wrap(f"Each takes {others}; what else it takes stands below it, with the defaults.", _WIDTH)
    yield ""
    indent = max((len(fault.rule) for fault in faults), default=0) + 2
    for fault in faults:
        yield from _entry(fault.rule, fault.title, indent)
        if fault.options:
            settings = " ".join(f"{name}={_value(value)}" for name, value in fault.options.items())
            yield from _entry("", settings, indent)
    yield ""
    yield "Scenarios: --scenario NAME[:OPTION=yes|no...]"
    yield from wrap("What an option does not say the seed decides.", _WIDTH)
    indent = max((len(scenario.name) for scenario in scenarios), default=0) + 2
    for scenario in scenarios:
        yield ""
        yield from _entry(scenario.name, f"{scenario.title} ({scenario.flight}, {scenario.seconds:g} s)", indent)
        yield from _entry("", scenario.story, indent)
        if scenario.options:
            yield from _entry("", " ".join(f"{option}=" for option in scenario.options), indent)


def _entry(name: str, text: str, indent: int) -> list[str]:
    start = f"{name:<{indent}}"
    return wrap(text, _WIDTH, initial_indent=start, subsequent_indent=" " * indent, break_on_hyphens=False)


def _value(value: Setting) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
