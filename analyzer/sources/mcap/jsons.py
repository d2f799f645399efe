"""CAN layouts in JSON: by the names in a JSON schema and in the messages of a channel."""

from __future__ import annotations

import json
from typing import Any

from analyzer.sources.mcap.fields import MOST, Node, hint, pick

# A schema or a message of CAN frames is never longer; and objects inside each other.
LONGEST, _DEEPEST = 1 << 18, 6
_KINDS = {"integer": "int", "number": "float", "boolean": "bool", "string": "text", "object": "object"}

Layout = tuple[str, list[tuple[str, tuple[Any, ...]]]]


def parsed(text: bytes) -> Any:
    """Return the value of a JSON text; raises `ValueError` if it is none or too long."""
    if len(text) > LONGEST:
        raise ValueError("too long")
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("nested too deep") from None


def layout_of(schema: Any, message: Any, *, named: bool) -> tuple[Layout | None, str]:
    """Return the layout, for the native walk, or what is to be said if there is none.

    `schema` and `message` are parsed, None for what is not there; `named`: names outside say that these are CAN frames.
    """
    described = _described(schema, schema, 0, [MOST])
    merged = _merge(described, {node.name: node for node in _held(message, 0, [MOST])})
    picked = pick(merged, named=named)
    if picked is None:
        return None, hint(merged, named=named)
    return ("json", [(one.native, one.path) for one in picked]), ""


def describes(schema: Any) -> bool:
    """Return whether a parsed schema names fields at all."""
    return bool(_described(schema, schema, 0, [MOST]))


def _merge(described: tuple[Node, ...], held: dict[str, Node]) -> tuple[Node, ...]:
    """Return the described fields with what a message shows of them, then those it has beside."""
    names = {node.name for node in described}
    return (
        *(_merged(node, held.get(node.name)) for node in described),
        *(node for name, node in held.items() if name not in names),
    )


def _merged(node: Node, held: Node | None) -> Node:
    if held is None or held.kind == "any":
        return node
    if node.kind == held.kind and node.below:
        return Node(node.name, node.key, node.kind, "", _merge(node.below, {one.name: one for one in held.below}))
    return Node(held.name, held.key, held.kind, node.form, held.below)


def _described(schema: Any, root: Any, depth: int, left: list[int]) -> tuple[Node, ...]:
    schema = _referred(schema, root)
    properties = schema.get("properties") if isinstance(schema, dict) else None
    if not isinstance(properties, dict) or depth == _DEEPEST:
        return ()
    out = []
    for name, value in properties.items():
        left[0] -= 1
        if left[0] < 0:
            break
        field = _referred(value, root)
        kind = field.get("type") if isinstance(field, dict) else None
        if kind == "array":
            below = _described(field.get("items"), root, depth + 1, left)
            out.append(Node(name, name, "objects" if below else "ints", "", below))
        elif isinstance(kind, str) and kind in _KINDS:
            form = str(field.get("contentEncoding", ""))
            out.append(Node(name, name, _KINDS[kind], form, _described(field, root, depth + 1, left)))
        else:
            out.append(Node(name, name, "any"))
    return tuple(out)


def _referred(schema: Any, root: Any) -> Any:
    """Return what a reference inside the same schema stands for."""
    reference = schema.get("$ref") if isinstance(schema, dict) else None
    if not isinstance(reference, str) or not reference.startswith("#/"):
        return schema
    for step in reference[2:].split("/", _DEEPEST):
        root = root.get(step) if isinstance(root, dict) else None
    return root


def _held(message: Any, depth: int, left: list[int]) -> tuple[Node, ...]:
    if isinstance(message, list):
        return (_value("", message, depth, left),)
    if not isinstance(message, dict) or depth == _DEEPEST:
        return ()
    out = []
    for name, value in message.items():
        left[0] -= 1
        if left[0] < 0:
            break
        out.append(_value(name, value, depth, left))
    return tuple(out)


def _value(name: str, value: Any, depth: int, left: list[int]) -> Node:
    if isinstance(value, bool | int | float | None):
        return Node(name, name, "any" if value is None else type(value).__name__)
    match value:
        case str():
            return Node(name, name, "text")
        case [dict() as first, *_]:
            return Node(name, name, "objects", "", _held(first, depth + 1, left))
        case list() if all(type(one) is int for one in value):
            return Node(name, name, "ints")
        case dict():
            return Node(name, name, "object", "", _held(value, depth + 1, left))
        case _:
            return Node(name, name, "")
