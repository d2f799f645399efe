"""ESCs by the channel that people call them, where a profile has such a column and no Python that names them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.vehicle.vocabulary import CHANNEL

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors import Registry
    from dissectors.kit import View


class ChannelLabels:
    """Gives the labels of nodes that say which channel they are."""

    def __init__(self, registry: Registry) -> None:
        told = (message for profile in registry.profiles if not profile.rules for message in profile.having("derived"))
        self._tables = [message.table for message in told if any(one.name == CHANNEL for one in message.derived)]

    def labels(self, view: View) -> Iterator[tuple[int, int, str]]:
        """Yield bus, node and label; of several the last one."""
        for name in self._tables:
            table = view.table(name)
            if table is None:
                continue
            rows = np.flatnonzero(table.trusted & table.has(CHANNEL))
            code = table.bus[rows].astype(np.int64) << 8 | table.src[rows]
            channels = np.rint(table[CHANNEL][rows]).astype(np.int64)
            last = dict(zip(code.tolist(), channels.tolist(), strict=True))
            yield from ((one >> 8, one & 0xFF, f"ch{channel}") for one, channel in last.items())
