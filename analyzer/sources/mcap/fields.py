"""Which fields of a described message make a CAN frame: found by their names, in JSON and in Protocol Buffers."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from analyzer.sources.mcap import names
from analyzer.sources.mcap.topics import says_can

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

# Fields of a description or of a message that are looked at, and nested messages on the way to a frame.
MOST = 4096
_DEEPEST = 4
_FRAME = frozenset({"id", "data"})
_STAMPS = frozenset({"stamp_ns", "stamp_us", "stamp_s", "sec"})

LISTS = "holds lists of frames, which are not read"
VAGUE = "has an identifier and data, but nothing says that they are CAN"


@dataclass(frozen=True, slots=True)
class Node:
    """A field: how a path names it, what its values are, how they are written, the name of a message's type.

    What is inside an `object`, or inside each of a list of `objects`, is `below`.
    """

    name: str
    key: Any
    kind: str
    form: str = ""
    below: tuple[Node, ...] = ()
    type: str = ""


@dataclass(frozen=True, slots=True)
class Picked:
    """A field with the role that it has in a frame."""

    role: str
    path: tuple[Any, ...]
    node: Node

    @property
    def native(self) -> str:
        """The role for the native walk: text is coded as its name or its form says, or else as messages show."""
        if self.role not in _FRAME or self.node.kind not in {"text", "any"}:
            return self.role
        told = f"{_plain(self.node.name)} {self.node.form.lower()}" if self.role == "data" else ""
        for coding, words in (("base64", ("base64",)), ("hex", ("hex", "base16"))):
            if any(word in told for word in words):
                return f"data_{coding}"
        return f"{self.role}_text"


def pick(nodes: Sequence[Node], *, named: bool) -> list[Picked] | None:
    """Return the fields of a frame: identifier and data side by side, perhaps deeper; the rest there or further out.

    Identifiers and data are in many messages: either something about these is CAN's own, or `named` says that it is.
    """
    return next((found for found, sure in _frames(nodes, (), 0, named=named) if sure or _own(found)), None)


def hint(nodes: Sequence[Node], *, named: bool) -> str:
    """Return what is to be said of a message in which no frame was found, empty for nothing."""
    if pick(nodes, named=True):
        return VAGUE
    return LISTS if _lists(nodes, named=named) else ""


def _lists(nodes: Sequence[Node], *, named: bool) -> bool:
    return any(
        (node.kind == "objects" and pick(node.below, named=named or says_can(node.name) or says_can(node.type)))
        or (node.kind in {"object", "objects"} and _lists(node.below, named=named))
        for node in nodes
    )


def _own(found: Sequence[Picked]) -> bool:
    """Return whether fields have names, or roles, that other messages than those of CAN do not have."""
    return any(
        (one.role in _FRAME and _plain(one.node.name) not in names.ANYWHERE)
        or (one.role in names.OWN and _plain(one.node.name) not in names.VAGUE)
        for one in found
    )


def _frames(
    nodes: Sequence[Node], path: tuple[Any, ...], depth: int, *, named: bool
) -> Iterator[tuple[list[Picked], bool]]:
    """All that may be a frame, the outermost first, and whether a name on the way there says CAN."""
    own = _level(nodes, path)
    if {one.role for one in own} >= _FRAME:
        yield own, named
    if depth == _DEEPEST:
        return
    for node in nodes:
        if node.kind != "object":
            continue
        told = named or says_can(node.name) or says_can(node.type)
        for inner, sure in _frames(node.below, (*path, node.key), depth + 1, named=told):
            roles = {one.role for one in inner}
            timed = not roles.isdisjoint(_STAMPS)
            outer = [one for one in own if one.role == "bus" or (one.role in {"nsec", *_STAMPS} and not timed)]
            yield inner + [one for one in outer if one.role not in roles], sure


def _level(nodes: Sequence[Node], path: tuple[Any, ...]) -> list[Picked]:
    """One field for each role, among the fields of one message."""
    named = _by_name(nodes)
    out = []
    for role, (kinds, wanted) in names.ROLES.items():
        if node := _first(named, wanted, kinds):
            out.append(Picked(role, (*path, node.key), node))
    header = _first(named, ("header",), ("object",))
    below = _by_name(header.below) if header else {}
    roles = {one.role for one in out}
    if header and "bus" not in roles and (name := _first(below, ("frameid",), ("text",))):
        out.append(Picked("bus", (*path, header.key, name.key), name))
    if roles.isdisjoint(_STAMPS):
        out += _stamp(named, path) or (_stamp(below, (*path, header.key)) if header else [])
    return out if "stamp_ns" not in roles else [one for one in out if one.role != "stamp_us"]


def _stamp(named: dict[str, list[Node]], path: tuple[Any, ...]) -> list[Picked]:
    """Return a time stamp of seconds, or of seconds and nanoseconds; whole numbers of an unknown unit are none."""
    node = _first(named, names.STAMP, ("object", "float"))
    if node is None:
        return []
    if node.kind == "float":
        return [Picked("stamp_s", (*path, node.key), node)]
    below = _by_name(node.below)
    seconds, rest = (_first(below, wanted, ("int",)) for wanted in (names.SECONDS, names.NANOSECONDS))
    if seconds is None or rest is None:
        return []
    path = (*path, node.key)
    return [Picked("sec", (*path, seconds.key), seconds), Picked("nsec", (*path, rest.key), rest)]


def _by_name(nodes: Sequence[Node]) -> dict[str, list[Node]]:
    out: dict[str, list[Node]] = {}
    for node in nodes:
        out.setdefault(_plain(node.name), []).append(node)
    return out


def _first(named: dict[str, list[Node]], wanted: tuple[str, ...], kinds: tuple[str, ...]) -> Node | None:
    """Of the fields with a suitable kind, the one whose name is wanted most."""
    fitting = (node for name in wanted for node in named.get(name, ()) if node.kind in {*kinds, "any"})
    return next(fitting, None)


def _plain(name: str) -> str:
    return re.sub(r"[_\-\s]", "", name).lower()
