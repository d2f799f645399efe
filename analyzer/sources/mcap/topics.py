"""A topic as it describes the frames of a channel: the bus, and whether they were sent or received."""

from __future__ import annotations

import re

TX, RX = 64, 128  # bits of the flags of a frame

_SENT = frozenset({"to_can_bus", "to_can_bus_fd"})
_RECEIVED = frozenset({"from_can_bus", "from_can_bus_fd"})
# Either direction of one bus.
_DIRECTIONS = _SENT | _RECEIVED | {"rx", "tx", "received", "sent", "receive", "send", "in", "out"}
_GENERIC = _DIRECTIONS | {
    *("can", "canbus", "can_bus", "can_raw", "canfd", "can_fd", "fd", "bus", "socketcan", "raw", "data"),
    *("frame", "frames", "can_frame", "can_frames", "msg", "msgs", "message", "messages"),
}
FALLBACK = "can"
# Words, and where they begin in names like `RawCANFrame`.
_WORD = re.compile(r"[a-z]+")
_HUMP = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_CAN = re.compile(r"(?:v|vx|sl|socket|uav|drone)?can(?:fd|bus|raw|data|id|(?:fd)?(?:frame|msg|message|packet)s?)?")
_LONGEST = 1 << 10


def says_can(name: str) -> bool:
    """Return whether a word of a name, of a topic, a type or a field, is about CAN."""
    name = name[:_LONGEST]
    words = {*_WORD.findall(name.lower()), *_WORD.findall(_HUMP.sub(" ", name).lower())}
    return any(_CAN.fullmatch(word) for word in words)


def direction(topic: str) -> int:
    """Return the flag bit that the last part of the topic stands for, else 0."""
    last = _parts(topic)[-1:]
    return TX if _SENT.intersection(last) else RX if _RECEIVED.intersection(last) else 0


class TopicNames:
    """Names of buses by topic, in the order of the channels.

    A name is the topic without the parts that any topic may have: `/can0/rx` is `can0`, `/truck/can1/frames` is
    `truck/can1`, `/can/raw` is `can`. Topics that differ only in the direction share a bus; if two others come to the
    same name, the second keeps the whole of its topic.
    """

    def __init__(self) -> None:
        self._taken: dict[str, tuple[str, ...]] = {}

    def bus(self, topic: str) -> str:
        """Return the name for a channel."""
        parts = _parts(topic)
        own = tuple(part for part in parts if part.lower() not in _DIRECTIONS)
        name = "/".join(part for part in own if part.lower() not in _GENERIC) or FALLBACK
        if self._taken.setdefault(name, own) != own:
            name = "/".join(own or parts) or FALLBACK
            self._taken.setdefault(name, own)
        return name


def _parts(topic: str) -> list[str]:
    return [part for part in topic.split("/") if part]
