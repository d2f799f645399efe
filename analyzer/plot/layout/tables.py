"""Tables that no picture speaks of: a tab for each, in it a plot for each field and the states of all."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.plot.layout import views

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    import rerun.blueprint as rrb

    from analyzer.plot.inventory import Series

MESSAGES = "messages"


def tables(series: Iterable[Series], wanted: Callable[[str], bool]) -> list[rrb.Container]:
    """Lay out a tab for each table that is wanted, of series called `table/field/…`."""
    found: dict[str, list[Series]] = {}
    for one in series:
        if one.owner != MESSAGES:
            continue
        name = one.quantity.split("/", 1)[0]
        if wanted(name):
            found.setdefault(name, []).append(one)
    short = _short(found)
    return [_table(here, short[name]) for name, here in sorted(found.items(), key=lambda pair: short[pair[0]])]


def _table(series: Sequence[Series], name: str) -> rrb.Container:
    fields: dict[str, list[Series]] = {}
    for one in series:
        if one.kind == "line":
            fields.setdefault(_field(one), []).append(one)
    parts = [
        views.plot(field, here, legend=not place, steps=True) for place, (field, here) in enumerate(fields.items())
    ]
    states = [one for one in series if one.kind == "state"]
    if states:
        parts.append(views.lanes("States", states))
    return views.grid(parts, name)


def _field(one: Series) -> str:
    """Return its name; the elements of a list share it."""
    return " ".join(part for part in one.quantity.split("/")[1:] if not part.isdigit())


def _short(names: Iterable[str]) -> dict[str, str]:
    """Return names without their namespaces, where they are still names of one table."""
    found = {name: _bare(name) for name in names}
    bare = list(found.values())
    return {name: one if bare.count(one) == 1 else name for name, one in found.items()}


def _bare(name: str) -> str:
    parts = name.split(".")
    while len(parts) > 1 and parts[0].islower():
        parts = parts[1:]
    return ".".join(parts)
