"""The throttle of a channel in the last moment: between which values it was."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING

import numpy as np

from dissectors.tmotor.rules.joined.joins import NO_CHANNEL, commands

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, View
    from dissectors.tmotor.rules.joined.joins import RawCommands

_MOST = 4096  # commands of a bus that are remembered from one batch to the next
_NOTHING = np.empty(0, np.int64), np.empty((0, 0), np.int16)


class RecentThrottles:
    """The commands of each bus in the last so many ns."""

    def __init__(self, long: int) -> None:
        self._long = long
        self._before: dict[int, tuple[Array, Array]] = {}  # times, and channels as `Commands.cmd` has them

    def spans(self, view: View, bus: int, asked: Iterable[tuple[int, int, int]]) -> Iterator[tuple[int, int]]:
        """Yield the lowest and highest throttle of a channel before a transfer, `NO_CHANNEL` without any.

        A channel, the number of the transfer and its time are asked for.
        """
        sent = commands(view).get(bus)
        earlier, channels = self._before.get(bus, _NOTHING)
        times, numbers = (earlier.tolist(), [] if sent is None else sent.number.tolist())
        here = [] if sent is None else sent.t.tolist()
        for index, number, t in asked:
            stop = bisect_left(numbers, number)
            first, now = bisect_left(times, t - self._long), bisect_left(here, t - self._long, 0, stop)
            parts = [(channels, first, len(times))] if first < len(times) else []
            if sent is not None and now < stop:
                parts.append((sent.cmd, now, stop))
            if not parts or any(index >= len(cmd) for cmd, _, _ in parts):
                yield NO_CHANNEL, NO_CHANNEL
                continue
            found = [cmd[index, begin:end] for cmd, begin, end in parts]
            yield min(int(one.min()) for one in found), max(int(one.max()) for one in found)

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
