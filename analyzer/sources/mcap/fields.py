"""Which fields of a described message make a CAN frame: found by their names, in JSON and in Protocol Buffers."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

# Role of the native walk -> kinds of values, and names without case and underscores, the likeliest first.
_ROLES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "id": (
        ("int", "float", "text"),
        ("canid", "arbitrationid", "messageid", "msgid", "frameid", "identifier", "id"),
    ),
    "data": (
        ("bytes", "ints", "text"),
        ("data", "payload", "candata", "bytevalues", "databytes", "datahex", "database64", "bytes"),
    ),
    "extended": (
        ("bool", "int"),
        ("extended", "isextended", "extendedid", "isextendedid", "iseff", "eff", "ide", "xtd"),
    ),
    "rtr": (("bool", "int"), ("rtr", "isrtr", "remote", "isremote", "remoteframe", "isremoteframe")),
    "error": (("bool", "int"), ("iserror", "iserrorframe", "errorframe", "error", "err")),
    "fd": (("bool", "int"), ("fd", "isfd", "isfdframe", "canfd", "iscanfd", "fdf")),
    "brs": (("bool", "int"), ("brs", "isbrs", "bitrateswitch")),
    "esi": (("bool", "int"), ("esi", "isesi", "errorstateindicator")),
    "dlc": (("int", "float"), ("dlc", "len", "length", "datalength")),
    "bus": (
        ("text", "int"),
        ("interface", "iface", "canbus", "caninterface", "interfacename", "bus", "busname", "busid", "channel"),
    ),
    "tx": (("bool", "int", "text"), ("tx", "istx", "direction")),
    "stamp_ns": (("int", "float", "text"), ("timestampns", "stampns", "timens", "timestampnsec", "timestampnanos")),
    "stamp_us": (("int", "float", "text"), ("timestampus", "stampus", "timeus", "timestampusec", "timestampmicros")),
}
_FRAME = frozenset({"id", "data"})
_STAMPS = frozenset({"stamp_ns", "stamp_us", "stamp_s", "sec"})
_STAMP = ("timestamp", "stamp", "time", "ts")
_SECONDS = ("seconds", "sec", "secs", "s")
_NANOSECONDS = ("nanos", "nsec", "nanosec", "nanoseconds", "nsecs", "ns")
# Nested messages on the way to a frame.
_DEEPEST = 4


@dataclass(frozen=True, slots=True)
class Node:
    """A field: how a path names it, what its values are (`object`: `below`), and how they are written."""

    name: str
    key: Any
    kind: str
    form: str = ""
    below: tuple[Node, ...] = ()


@dataclass(frozen=True, slots=True)
class Picked:
    """A field with the role that it has in a frame."""

    role: str
    path: tuple[Any, ...]
    node: Node


def pick(nodes: Sequence[Node]) -> list[Picked] | None:
    """The fields of a frame: identifier and data side by side, perhaps deeper; the rest there or further out."""
    return _pick(nodes, (), 0)


def _pick(nodes: Sequence[Node], path: tuple[Any, ...], depth: int) -> list[Picked] | None:
    own = _level(nodes, path)
    if {one.role for one in own} >= _FRAME:
        return own
    if depth == _DEEPEST:
        return None
    for node in nodes:
        inner = _pick(node.below, (*path, node.key), depth + 1) if node.kind == "object" else None
        if inner is not None:
            roles = {one.role for one in inner}
            timed = not roles.isdisjoint(_STAMPS)
            outer = [one for one in own if one.role == "bus" or (one.role in {"nsec", *_STAMPS} and not timed)]
            return inner + [one for one in outer if one.role not in roles]
    return None


def _level(nodes: Sequence[Node], path: tuple[Any, ...]) -> list[Picked]:
    """One field for each role, among the fields of one message."""
    out = []
    for role, (kinds, names) in _ROLES.items():
        if node := _first(nodes, names, kinds):
            out.append(Picked(role, (*path, node.key), node))
    header = _first(nodes, ("header",), ("object",))
    roles = {one.role for one in out}
    if header and "bus" not in roles and (name := _first(header.below, ("frameid",), ("text",))):
        out.append(Picked("bus", (*path, header.key, name.key), name))
    if roles.isdisjoint(_STAMPS):
        out += _stamp(nodes, path) or (_stamp(header.below, (*path, header.key)) if header else [])
    return out[:] if "stamp_ns" not in roles else [one for one in out if one.role != "stamp_us"]


def _stamp(nodes: Sequence[Node], path: tuple[Any, ...]) -> list[Picked]:
    """A time stamp of seconds, or of seconds and nanoseconds; whole numbers of an unknown unit are none."""
    node = _first(nodes, _STAMP, ("object", "float"))
    if node is None:
        return []
    if node.kind == "float":
        return [Picked("stamp_s", (*path, node.key), node)]
    seconds, rest = (_first(node.below, names, ("int",)) for names in (_SECONDS, _NANOSECONDS))
    if seconds is None or rest is None:
        return []
    path = (*path, node.key)
    return [Picked("sec", (*path, seconds.key), seconds), Picked("nsec", (*path, rest.key), rest)]


def _first(nodes: Sequence[Node], names: tuple[str, ...], kinds: tuple[str, ...]) -> Node | None:
    """Of the fields with a suitable kind, the one whose name is wanted most."""
    fitting = {_plain(node.name): node for node in reversed(nodes) if node.kind in {*kinds, "any"}}
    return next((fitting[name] for name in names if name in fitting), None)


def _plain(name: str) -> str:
    return re.sub(r"[_\-\s]", "", name).lower()
