"""Names of types, for people."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.tables import KINDS

if TYPE_CHECKING:
    from dissectors.schema import Message


def short(name: str) -> str:
    """Return the last word of a type's name."""
    return name.rpartition(".")[2]


def type_name(message: Message | None, kind: int, type_id: int) -> str:
    """Return what a listing calls a type: its short name, or its number when unknown."""
    if message is not None:
        return short(message.name)
    return f"{'service' if kind >= KINDS.index('request') else 'type'} {type_id}"
