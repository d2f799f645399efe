"""What the proofs about values look at: transfers with their fields, and data that is made of packets."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from kit import encode

from witness.fields import Fields, unpack
from witness.reader import Log, Transfer

Found = list[set[int]]  # each finding: the numbers of the frames that show it
Finder = Callable[[Log], Found]

SECOND = 10**9
MILLISECOND = 10**6


@dataclass(frozen=True, slots=True, eq=False)
class Message:
    """A transfer that arrived whole, with the values that its payload has."""

    transfer: Transfer
    payload: bytes
    fields: Fields

    @property
    def name(self) -> str:
        return self.transfer.name

    @property
    def src(self) -> int:
        return self.transfer.first.src

    @property
    def t(self) -> int:
        """When its last frame came."""
        return self.transfer.frames[-1].t

    @property
    def numbers(self) -> set[int]:
        return self.transfer.numbers

    @property
    def values(self) -> dict[str, Any]:
        return self.fields.values

    def __getitem__(self, name: str) -> Any:
        return self.fields.values[name]


@lru_cache(maxsize=64)
def everything(log: Log) -> tuple[Message, ...]:
    """All transfers of known types whose CRC is right, in the order of their first frames."""
    whole = [one for one in log.transfers if one.name and one.status == "ok"]
    return tuple(Message(one, one.payload, unpack(one.name, one.payload, one.first.fd)) for one in whole)


@lru_cache(maxsize=256)
def messages(log: Log, *names: str) -> tuple[Message, ...]:
    """Those of some types that hold every field."""
    return tuple(one for one in everything(log) if one.name in names and not one.fields.missing)


def where(log: Log, names: tuple[str, ...], wrong: Callable[[Message], bool]) -> Found:
    """The transfers of some types that are wrong."""
    return [one.numbers for one in messages(log, *names) if wrong(one)]


def prefixed(one: Message) -> bool:
    """Does a length that classic CAN leaves out stand before its last array (TYP-006)?"""
    if one.transfer.first.fd:
        return False
    payload = one.payload
    if one.name in encode.HEADERS:
        return payload[4:5] == bytes([len(payload) - 5 & 0xFF]) and payload[5:7] in encode.HEADERS.values()
    if one.name == "ParamGet" and len(payload) == 74:
        return payload[41] == 32 or (payload[41] >> 2 == 32 and not payload[73] & 3)
    if one.name == "RawCommand" and len(payload) == 36:
        bits = "".join(f"{byte:08b}" for byte in payload)
        narrow = int(bits[:5], 2) == 20 and not int(bits[285:], 2)
        return payload[0] == 20 or narrow
    return False


class Latest:
    """Looks up what was sent around a time, in messages in the order of their ends."""

    def __init__(self, sent: list[Message]) -> None:
        self.sent = sorted(sent, key=lambda one: one.t)
        self.times = [one.t for one in self.sent]

    def between(self, start: int, end: int) -> list[Message]:
        """Those that ended from `start` to `end`, both included."""
        return self.sent[bisect_left(self.times, start) : bisect_right(self.times, end)]

    def nearest(self, t: int, within: int) -> Message | None:
        """The one that ended nearest to `t`, `within` ns."""
        near = self.between(t - within, t + within)
        return min(near, key=lambda one: abs(one.t - t)) if near else None


def by_node(log: Log, name: str) -> dict[int, list[Message]]:
    """The messages of a type, by the node that sent them."""
    found: dict[int, list[Message]] = {}
    for one in messages(log, name):
        found.setdefault(one.src, []).append(one)
    return found
