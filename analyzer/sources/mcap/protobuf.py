"""CAN layouts in Protocol Buffers: by the names of the fields in the schema's own descriptors, never by number."""

from __future__ import annotations

from typing import Any

from analyzer.sources.mcap.descriptor import Field, messages
from analyzer.sources.mcap.fields import Node, pick

_KINDS = {"bytes": "bytes", "string": "text", "float": "float", "double": "float"}
# Messages inside each other, and fields altogether.
_DEEPEST, _MOST = 6, 4096

Layout = tuple[str, list[tuple[str, tuple[Any, ...], str]]]


def layout_of(name: str, descriptors: bytes) -> tuple[Layout | None, bool]:
    """The layout, for the native walk; and whether lists of frames are what a message without one holds."""
    try:
        found = messages(descriptors)
    except ValueError:
        return None, False
    nodes = _nodes(found, name.removeprefix("."), 0, [_MOST])
    picked = pick(nodes)
    if picked is None:
        lists = (field for field in found.get(name, ()) if field.repeated and field.wire == "message")
        return None, any(pick(_nodes(found, field.kind, 0, [_MOST])) for field in lists)
    return ("protobuf", [(one.role, one.path, one.node.form) for one in picked]), False


def _nodes(found: dict[str, list[Field]], name: str, depth: int, left: list[int]) -> tuple[Node, ...]:
    if depth == _DEEPEST:
        return ()
    out = []
    for field in found.get(name, ()):
        left[0] -= 1
        if left[0] < 0:
            break
        if field.wire == "message" and not field.repeated:
            out.append(Node(field.name, field.number, "object", "", _nodes(found, field.kind, depth + 1, left)))
        elif field.wire and field.repeated:
            if field.wire == "varint":
                out.append(Node(field.name, field.number, "ints", "packed"))
        elif field.wire and field.wire != "message":
            kind = "bool" if field.boolean else _KINDS.get(field.wire, "int")
            out.append(Node(field.name, field.number, kind, field.wire))
    return tuple(out)
