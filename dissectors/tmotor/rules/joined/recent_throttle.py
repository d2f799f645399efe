"""The throttle of a channel in the last moment: between which values it was."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.tmotor.rules.joined.joins import NO_CHANNEL, commands

if TYPE_CHECKING:
    from dissectors.kit import Array, View
    from dissectors.tmotor.rules.joined.joins import RawCommands

_MOST = 4096  # commands of a bus that are remembered from one batch to the next


class RecentThrottles:
    """The commands of each bus in the last so many ns."""

    def __init__(self, long: int) -> None:
        self._long = long
        self._before: dict[int, tuple[Array, Array]] = {}  # times, and channels as `Commands.cmd` has them

    def span(self, view: View, bus: int, index: int, number: int, t: int) -> tuple[int, int]:
        """Return the lowest and highest throttle of a channel before a transfer, `NO_CHANNEL` without any."""
        sent = commands(view).get(bus)
        some = [self._before[bus]] if bus in self._before else []
        if sent is not None:
            stop = int(np.searchsorted(sent.number, number))
            some.append((sent.t[:stop], sent.cmd[:, :stop]))
        parts = []
        for times, channels in some:
            first = int(np.searchsorted(times, t - self._long)) if len(times) else 0
            if index < len(channels):
                parts.append(channels[index, first:])
            elif first < len(times):
                return NO_CHANNEL, NO_CHANNEL
        found = np.concatenate(parts) if parts else np.empty(0, np.int16)
        return (int(found.min()), int(found.max())) if len(found) else (NO_CHANNEL, NO_CHANNEL)

    def feed(self, view: View) -> None:
        """Make the commands of a batch, once it has been looked at, those before the next one."""
        for bus, sent in commands(view).items():
            self._before[bus] = self._joined(bus, sent)

    def _joined(self, bus: int, sent: RawCommands) -> tuple[Array, Array]:
        first = max(int(np.searchsorted(sent.t, sent.t[-1] - self._long)), len(sent.t) - _MOST)
        times, cmd = sent.t[first:], sent.cmd[:, first:]
        if first or bus not in self._before:
            return times.copy(), cmd.copy()
        old, channels = self._before[bus]
        keep = max(int(np.searchsorted(old, sent.t[-1] - self._long)), len(old) + len(times) - _MOST)
        most = max(len(channels), len(cmd))
        return np.concatenate((old[keep:], times)), np.concatenate(
            (_padded(channels[:, keep:], most), _padded(cmd, most)), axis=1
        )


def _padded(channels: Array, most: int) -> Array:
    """Return rows for more channels, `NO_CHANNEL` in each."""
    more = np.full((most - len(channels), channels.shape[1]), NO_CHANNEL, channels.dtype)
    return np.concatenate((channels, more))
