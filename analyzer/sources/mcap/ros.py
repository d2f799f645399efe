"""CAN layouts in the definitions of ROS messages: found by the fields, in the order of their bytes."""

from __future__ import annotations

import re

from analyzer.sources.mcap.idl import structs

# No definition of a CAN message is longer, or nested deeper, or has as many fields with all that are nested.
_LONGEST, _DEEPEST, _FIELDS = 1 << 16, 8, 256
_RULE = re.compile(r"^={3,}[ \t\r]*$", re.MULTILINE)
_TITLE = re.compile(r"\s*(?:MSG|IDL): *(\S+)")
_FIELD = re.compile(r"\s*([A-Za-z][\w/]*(?:<=\d+)?(?:\[(?:<=)?\d*\])?)\s+([A-Za-z]\w*)\s*(=?)")

Fields = list[tuple[str, str]]

# What a writer may leave out because every reader knows it, as (type, name).
_STAMPS: dict[str, dict[str, Fields]] = {
    "ros2": {
        "std_msgs/Header": [("builtin_interfaces/Time", "stamp"), ("string", "frame_id")],
        "builtin_interfaces/Time": [("int32", "sec"), ("uint32", "nanosec")],
    },
    "ros1": {"std_msgs/Header": [("uint32", "seq"), ("time", "stamp"), ("string", "frame_id")]},
}
_BYTE = {"byte": "uint8", "char": "uint8"}
_FLAGS = "bool is_extended, bool is_error"
_LAYOUTS = {
    "can_msgs/Frame": f"uint32 id, bool is_rtr, {_FLAGS}, uint8 dlc, uint8[8] data",
    "ros2_socketcan/FdFrame": f"uint32 id, {_FLAGS}, uint8 len, uint8[<=64] data",
    "ros2_socketcan/Frame": f"uint32 id, bool is_rtr, {_FLAGS}, bool is_fd_frame, uint8 dlc, uint8[64] data",
}
# Names that stand for a layout even where the definition is missing.
_NAMES = {
    "can_msgs/Frame": "can_msgs/Frame",
    "ros2_socketcan_msgs/FdFrame": "ros2_socketcan/FdFrame",
    "ros2_socketcan_msgs/Frame": "ros2_socketcan/Frame",
}


def layout_of(name: str, encoding: str, definition: bytes, flavour: str) -> str | None:
    """Return the layout of a message; `flavour` is `ros2` (CDR) or `ros1`, `encoding` that of the definition."""
    short = _short(name)
    if not definition.strip():
        return _NAMES.get(short)
    if len(definition) > _LONGEST:
        return None
    text = definition.decode(errors="replace")
    types = dict(_STAMPS[flavour])
    types |= _structs(text) if encoding in {"ros2idl", "omgidl"} else _messages(short, text)
    flat = _flat(types, short, "", 0, [_FIELDS])
    return _KNOWN.get((flavour, tuple(flat))) if flat else None


def can_name(name: str) -> bool:
    """Return whether the name is that of a known layout."""
    return _short(name) in _NAMES


def _short(name: str) -> str:
    return name.replace("::", "/").replace("/msg/", "/")


def _messages(name: str, text: str) -> dict[str, Fields]:
    """Return the message definitions of a `ros1msg` or `ros2msg` schema; the first has no title of its own."""
    types: dict[str, Fields] = {}
    for section in _RULE.split(text):
        title = _TITLE.match(section)
        own = _short(title[1]) if title else name
        body = section[title.end() :] if title else section
        matches = (_FIELD.match(line.partition("#")[0]) for line in body.splitlines())
        types.setdefault(own, [(match[1], match[2]) for match in matches if match and not match[3]])
    return types


def _structs(text: str) -> dict[str, Fields]:
    types: dict[str, Fields] = {}
    for section in _RULE.split(text):
        title = _TITLE.match(section)
        for name, fields in structs(section[title.end() :] if title else section).items():
            types.setdefault(_short(name), [(_short(kind), field) for kind, field in fields])
    return types


def _flat(
    types: dict[str, Fields], name: str, prefix: str, depth: int, left: list[int]
) -> list[tuple[str, str]] | None:
    """Return the fields with everything nested in place; None if a type is unknown or the nesting too deep."""
    if name not in types or depth == _DEEPEST:
        return None
    flat: list[tuple[str, str]] = []
    for kind, field in types[name]:
        left[0] -= 1
        if left[0] < 0:
            return None
        package = name.rpartition("/")[0]
        inner = next((full for full in (_short(kind), f"{package}/{kind}", f"std_msgs/{kind}") if full in types), None)
        if inner is None:
            base, bracket, rest = kind.partition("[")
            flat.append((_BYTE.get(base, base) + bracket + rest, prefix + field))
            continue
        below = _flat(types, inner, f"{prefix}{field}.", depth + 1, left)
        if below is None:
            return None
        flat += below
        if len(flat) > _MOST:
            return None
    return flat


_MOST = max(len(fields.split(", ")) for fields in _LAYOUTS.values()) + 3


def _known() -> dict[tuple[str, tuple[tuple[str, str], ...]], str]:
    known = {}
    for flavour, types in _STAMPS.items():
        header = _flat(types, "std_msgs/Header", "header.", 0, [_FIELDS]) or []
        for layout, text in _LAYOUTS.items():
            pairs = [field.split(" ") for field in text.split(", ")]
            known[flavour, (*header, *((kind, name) for kind, name in pairs))] = layout
    return known


_KNOWN = _known()
