"""CAN layouts in JSON: by the names in a JSON schema and in the first message of a channel."""

from __future__ import annotations

import json
import re
from typing import Any

from analyzer.sources.mcap.fields import Node, Picked, pick

# A schema or a message of CAN frames is never longer; and objects inside each other.
LONGEST, _DEEPEST = 1 << 18, 6
_KINDS = {"integer": "int", "number": "float", "boolean": "bool", "string": "text", "object": "object"}
_HEX = re.compile(r"(?:[0-9A-Fa-f]{2}[ :.\-]*)*")

Layout = tuple[str, list[tuple[str, tuple[Any, ...]]]]


def parsed(text: bytes) -> Any:
    """The value of a JSON text, None if it is none or too long."""
    try:
        return json.loads(text) if len(text) <= LONGEST else None
    except (ValueError, RecursionError):
        return None


def layout_of(schema: Any, message: Any) -> Layout | None:
    """The layout, for the native walk, from a parsed schema (None: there is none) and a parsed first message."""
    held = {node.name: node for node in _held(message, 0)}
    described = _described(schema, schema, 0)
    merged = _merge(described, held)
    picked = pick(merged)
    return None if picked is None else ("json", [(_role(one), one.path) for one in picked])


def _merge(described: tuple[Node, ...], held: dict[str, Node]) -> tuple[Node, ...]:
    """Described fields with what a message shows of them (a number is whole, a text hex), then those it has beside."""
    names = {node.name for node in described}
    return (
        *(_merged(node, held.get(node.name)) for node in described),
        *(node for name, node in held.items() if name not in names),
    )


def _merged(node: Node, held: Node | None) -> Node:
    if held is None or held.kind == "any":
        return node
    if node.kind == "object" == held.kind:
        below = _merge(node.below, {one.name: one for one in held.below})
        return Node(node.name, node.key, "object", "", below)
    return Node(held.name, held.key, held.kind, node.form or held.form, held.below)


def _described(schema: Any, root: Any, depth: int) -> tuple[Node, ...]:
    schema = _referred(schema, root)
    properties = schema.get("properties") if isinstance(schema, dict) else None
    if not isinstance(properties, dict) or depth == _DEEPEST:
        return ()
    out = []
    for name, value in properties.items():
        field = _referred(value, root)
        kind = field.get("type") if isinstance(field, dict) else None
        if kind == "array":
            out.append(Node(name, name, "ints"))
        elif isinstance(kind, str) and kind in _KINDS:
            form = str(field.get("contentEncoding", ""))
            out.append(Node(name, name, _KINDS[kind], form, _described(field, root, depth + 1)))
        else:
            out.append(Node(name, name, "any"))
    return tuple(out)


def _referred(schema: Any, root: Any) -> Any:
    """What a reference inside the same schema stands for."""
    reference = schema.get("$ref") if isinstance(schema, dict) else None
    if not isinstance(reference, str) or not reference.startswith("#/"):
        return schema
    for step in reference[2:].split("/"):
        root = root.get(step) if isinstance(root, dict) else None
    return root


def _held(message: Any, depth: int) -> tuple[Node, ...]:
    if not isinstance(message, dict) or depth == _DEEPEST:
        return ()
    return tuple(_value(name, value, depth) for name, value in message.items())


def _value(name: str, value: Any, depth: int) -> Node:
    if isinstance(value, bool | int | float | None):
        return Node(name, name, "any" if value is None else type(value).__name__)
    match value:
        case str():
            return Node(name, name, "text", "" if not value else "hex" if _HEX.fullmatch(value) else "base64")
        case list() if all(type(one) is int for one in value):
            return Node(name, name, "ints")
        case dict():
            return Node(name, name, "object", "", _held(value, depth + 1))
        case _:
            return Node(name, name, "")


def _role(one: Picked) -> str:
    """Bytes in a text are base64 if the schema, the name or the first message says so, else hex."""
    if one.role != "data" or one.node.kind != "text":
        return one.role
    base64 = "base64" in one.node.name.lower().replace("_", "") or one.node.form == "base64"
    return "data_base64" if base64 else "data_hex"
