"""Fields that no row can have together: those of messages that never share a transfer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.filter.nodes import Condition, Junction, Negation, RowNode, ValueNode

if TYPE_CHECKING:
    from dissectors import Registry

Carriers = frozenset[str]


def carriers(of: Condition | ValueNode, registry: Registry) -> Carriers | None:
    """Return the messages of which a row has to be so that it can hold; none if it never can, None if any will do."""
    if isinstance(of, Condition):
        return _of_condition(of, registry)
    if of.children:
        return _all_of([carriers(child, registry) for child in of.children], either=isinstance(of, RowNode))
    tables = [ref.tables for ref in of.fields() if ref.origin in ("table", "type")]
    return frozenset(_carrier(table, registry) for some in tables for table in some) if tables else None


def _of_condition(of: Condition, registry: Registry) -> Carriers | None:
    if isinstance(of, Negation):
        return None
    if isinstance(of, Junction):
        return _all_of([carriers(part, registry) for part in of.parts], either=not of.both)
    return _all_of([carriers(value, registry) for value in of.operands], either=False)


def _all_of(every: list[Carriers | None], *, either: bool) -> Carriers | None:
    """Return what rows have to be for each of some, or for `either` of them."""
    if either:
        known = [one for one in every if one is not None]
        return frozenset().union(*known) if len(known) == len(every) else None
    found: Carriers | None = None
    for one in every:
        if one is not None:
            found = one if found is None else found & one
    return found


def _carrier(table: str, registry: Registry) -> str:
    """Return the message that a packet lies in, or the message itself."""
    return table if registry.message_of(table) is not None else table.rpartition(".")[0]


def apart(of: Condition | ValueNode) -> str:
    """Return why no row has all the fields of something."""
    named = dict.fromkeys(ref.tables[0] for ref in of.fields() if ref.origin in ("table", "type"))
    return (
        f"no row has both {' and '.join(named)}: a rule in a vehicle file compares with the value told last "
        "(tailbyte help own-rules), lag() with what the same field was before"
    )
