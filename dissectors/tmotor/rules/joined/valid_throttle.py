"""The last valid throttle of each channel: one that is not negative (4.4.1 explanation 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, last_set
from dissectors.tmotor.rules.joined.joins import NO_CHANNEL, last_of

if TYPE_CHECKING:
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


class ValidThrottle:
    """The commands of one bus so far."""

    def __init__(self) -> None:
        self._t = np.full(CHANNELS, NO_TIME)
        self._value = np.zeros(CHANNELS, np.int64)
        self._last = np.full(CHANNELS, NO_CHANNEL, np.int64)

    def steady(self, sent: RawCommands | None, channel: int, until: int, longest: int) -> bool:
        """Return whether no two valid throttles of the next commands, nor the last one and a time, are far apart."""
        if sent is None or channel >= len(sent.cmd) or self._t[channel] == NO_TIME:
            return False
        apart = np.diff(sent.t, prepend=self._t[channel])
        valid = bool((sent.cmd[channel] >= 0).all())
        return valid and int(apart.max()) <= longest and until - int(sent.t[-1]) <= longest

    def at(self, sent: RawCommands | None, channel: int, number: Array) -> LastThrottle:
        """Return what it was at each of some transfers; `sent` are the next commands, which are not yet fed."""
        before = (int(part[channel]) for part in (self._t, self._value, self._last))
        if sent is None:
            return LastThrottle(*(np.full(len(number), one) for one in before))
        cmd, count = sent.channel(channel), np.searchsorted(sent.number, number)
        valid = cmd >= 0
        latest = count if valid.all() else np.append(0, last_set(valid) + 1)[count]
        columns = ((sent.t, latest), (cmd, latest), (cmd, count))
        return LastThrottle(*(last_of(*column, one) for column, one in zip(columns, before, strict=True)))

    def feed(self, sent: RawCommands) -> None:
        """Make the next commands the last ones."""
        for channel in range(CHANNELS):
            cmd = sent.channel(channel)
            self._last[channel] = cmd[-1]
            valid = cmd >= 0
            if valid[-1]:
                self._t[channel], self._value[channel] = sent.t[-1], cmd[-1]
            elif valid.any():
                at = int(np.flatnonzero(valid)[-1])
                self._t[channel], self._value[channel] = sent.t[at], cmd[at]
