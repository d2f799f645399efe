"""The last valid throttle of each channel: one that is not negative (4.4.1 explanation 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME
from dissectors.kit.order import spans
from dissectors.tmotor.rules.joined.joins import NO_CHANNEL

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from dissectors.kit import Array
    from dissectors.tmotor.rules.joined.joins import RawCommands

CHANNELS = 32


class LastThrottle(NamedTuple):
    """For some transfers: time and value of the last valid throttle, `NO_TIME` without any, and the last of any kind.

    `last` is `NO_CHANNEL` where the last command was too short for the channel.
    """

    t: Array
    value: Array
    last: Array


class CommandGaps(NamedTuple):
    """Commands of a bus: times of the first and the last one, the longest time between two, and valid channels."""

    first: int
    last: int
    longest: int
    valid: list[bool]

    @classmethod
    def of(cls, sent: RawCommands) -> CommandGaps:
        """Return those of some."""
        longest = int((sent.t[1:] - sent.t[:-1]).max(initial=0))
        valid = np.logical_and.reduce(sent.cmd >= 0, axis=1)
        return cls(sent.t.item(0), sent.t.item(-1), longest, valid.tolist())


class ValidThrottle:
    """The commands of one bus so far."""

    def __init__(self) -> None:
        self._t = np.full(CHANNELS, NO_TIME)
        self._value = np.zeros(CHANNELS, np.int64)
        self._last = np.full(CHANNELS, NO_CHANNEL, np.int64)
        self._valid: tuple[RawCommands, Array | None] | None = None  # what was asked of the next commands

    def steady(self, gaps: CommandGaps | None, channel: int, until: int, longest: int) -> bool:
        """Return whether no two valid throttles of the next commands, nor the last one and a time, are far apart."""
        if gaps is None or channel >= len(gaps.valid) or self._t[channel] == NO_TIME:
            return False
        apart = max(gaps.longest, gaps.first - self._t.item(channel))
        return gaps.valid[channel] and apart <= longest and until - gaps.last <= longest

    def at(self, sent: RawCommands | None, channel: Array | int, number: Array) -> LastThrottle:
        """Return what it was at each of some transfers, of one channel or of one each.

        `sent` are the next commands, which are not yet fed.
        """
        before = LastThrottle(*(np.broadcast_to(part[channel], number.shape) for part in self._columns))
        if sent is None:
            return before
        count, inside = np.searchsorted(sent.number, number), channel < np.int64(len(sent.cmd))
        cmd = sent.cmd if len(sent.cmd) else sent.channel(0)[None]
        row = np.minimum(channel, len(cmd) - 1)
        valid = self._valid_up_to(sent, cmd)
        latest = count if valid is None else np.where(count > 0, valid[row, np.maximum(count, 1) - 1], 0)
        latest = np.where(inside, latest, 0)
        at, last = np.maximum(latest, 1) - 1, np.maximum(count, 1) - 1
        return LastThrottle(
            np.where(latest > 0, sent.t[at], before.t), np.where(latest > 0, cmd[row, at], before.value),
            np.where(count > 0, np.where(inside, cmd[row, last], NO_CHANNEL), before.last),
        )  # fmt: skip

    def _valid_up_to(self, sent: RawCommands, cmd: Array) -> Array | None:
        """Return of each channel the place, from 1, of the last valid throttle up to each command; None: all are."""
        if self._valid is None or self._valid[0] is not sent:
            valid = cmd >= 0
            places = np.arange(1, len(sent.t) + 1)
            self._valid = sent, (None if valid.all() else np.maximum.accumulate(np.where(valid, places, 0), axis=1))
        return self._valid[1]

    @property
    def _columns(self) -> tuple[Array, Array, Array]:
        return self._t, self._value, self._last

    def feed(self, sent: RawCommands) -> None:
        """Make the next commands the last ones."""
        self._valid = None
        cmd = sent.cmd[:CHANNELS]
        self._last[:] = NO_CHANNEL
        self._last[: len(cmd)] = cmd[:, -1]
        valid = cmd >= 0
        some = np.flatnonzero(valid.any(axis=1))
        at = valid.shape[1] - 1 - valid[some, ::-1].argmax(axis=1)
        self._t[some], self._value[some] = sent.t[at], cmd[some, at]


class ValidThrottles:
    """The commands of each bus so far."""

    def __init__(self) -> None:
        self._buses: dict[int, ValidThrottle] = {}

    def of(self, bus: int) -> ValidThrottle:
        """Return those of a bus."""
        return self._buses.get(bus) or ValidThrottle()

    def buses(self) -> Iterable[int]:
        """Return the buses that have any."""
        return self._buses.keys()

    def at(self, now: Mapping[int, RawCommands], bus: Array, channel: Array, number: Array) -> LastThrottle:
        """Return what it was at each of some transfers, which stand together by bus; `now` are the next commands."""
        parts = [self.of(one).at(now.get(one), channel[begin:end], number[begin:end]) for one, begin, end in spans(bus)]
        return parts[0] if len(parts) == 1 else LastThrottle(*map(np.concatenate, zip(*parts, strict=True)))

    def feed(self, now: Mapping[int, RawCommands]) -> None:
        """Make the next commands the last ones."""
        for bus, sent in now.items():
            if bus not in self._buses:
                self._buses[bus] = ValidThrottle()
            self._buses[bus].feed(sent)
