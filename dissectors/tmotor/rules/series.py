"""What a node sent before: previous rows of the same node, across batches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dissectors.conformance import Table, Words

NODES = 1 << 15  # 8 bits of bus, 7 of node ID


def usable(table: Table) -> Words:
    """Rows with a good CRC that hold every field."""
    return table.trusted & (table["bits_left"] >= 0)


def sender(table: Table, rows: Words) -> Words:
    """Bus and node of rows in one number below `NODES`."""
    node = table.bus[rows].astype(np.uint16) << 7
    node |= table.src[rows] & 0x7F
    return node


class Previous:
    """Several values of each node, as they were in the row before.

    Args:
        start: the values of a node that sent nothing yet.
    """

    def __init__(self, *start: int) -> None:
        self._last = np.tile(np.array(start, np.int64)[:, None], NODES)

    def all(self, value: int) -> bool:
        """Whether the last values of all nodes are this."""
        return bool((self._last == value).all())

    def take(self, node: Words, *values: Words) -> tuple[Words, Words]:
        """The previous values of each row, one row of the result a value, and the previous row itself.

        `node` is as `sender` gives it; a previous row is -1 if it stood in an earlier batch or was none.
        """
        order = np.argsort(node, kind="stable")
        nodes = node[order]
        starts = np.ones(len(nodes), bool)
        np.not_equal(nodes[1:], nodes[:-1], out=starts[1:])
        ends = np.append(starts[1:], True)[: len(nodes)]
        before = np.empty((len(values), len(nodes)), np.int64)
        for k, column in enumerate(values):
            ordered = column[order].astype(np.int64)
            previous = np.empty_like(ordered)
            previous[1:] = ordered[:-1]
            previous[starts] = self._last[k, nodes[starts]]
            self._last[k, nodes[ends]] = ordered[ends]
            before[k, order] = previous
        row = np.empty(len(nodes), np.int64)
        row[order[1:]] = order[:-1]
        row[order[starts]] = -1
        return before, row
