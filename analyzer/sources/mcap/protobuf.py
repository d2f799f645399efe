"""CAN layouts in Protocol Buffers: by the names of the fields in the schema's own descriptors, never by number."""

from __future__ import annotations

from typing import Any

from analyzer.sources.mcap.descriptor import Field, messages
from analyzer.sources.mcap.fields import MOST, Node, hint, pick

_KINDS = {"bytes": "bytes", "string": "text", "float": "float", "double": "float"}
# Messages inside each other.
_DEEPEST = 6

Layout = tuple[str, list[tuple[str, tuple[Any, ...], str]]]


def layout_of(name: str, descriptors: bytes, *, named: bool) -> tuple[Layout | None, str]:
    """Return the layout for the native walk, or what to say if there is none; `named`: names outside say CAN."""
    try:
        found = messages(descriptors)
    except ValueError:
        return None, ""
    name = name.removeprefix(".")
    picked = pick(_nodes(found, name, 0, [MOST]), named=named)
    if picked is None:
        return None, hint(_nodes(found, name, 0, [MOST], lists=True), named=named)
    return ("protobuf", [(one.native, one.path, one.node.form) for one in picked]), ""


def _nodes(
    found: dict[str, list[Field]], name: str, depth: int, left: list[int], *, lists: bool = False
) -> tuple[Node, ...]:
    """Return the fields of a message; with `lists` repeated messages are among them."""
    if depth == _DEEPEST:
        return ()
    out = []
    for field in found.get(name, ()):
        left[0] -= 1
        if left[0] < 0:
            break
        if field.wire == "message":
            if lists or not field.repeated:
                below = _nodes(found, field.kind, depth + 1, left, lists=lists)
                kind = "objects" if field.repeated else "object"
                out.append(Node(field.name, field.number, kind, "", below, field.kind))
        elif field.repeated:
            if field.wire == "varint":
                out.append(Node(field.name, field.number, "ints", "packed"))
        elif field.wire:
            kind = "bool" if field.boolean else _KINDS.get(field.wire, "int")
            out.append(Node(field.name, field.number, kind, field.wire))
    return tuple(out)
