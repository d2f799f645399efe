"""What was said before, across batches: the previous rows of the same node, the last number of a key."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.tmotor.rules.rows import NODES

if TYPE_CHECKING:
    from dissectors.conformance import Words

_PAGE = 15
_REST = (1 << _PAGE) - 1


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


class Latest:
    """A number for each key, the last one said; 0 where there is none. Keys are small numbers from 0."""

    def __init__(self) -> None:
        self._values: dict[int, Words] = {}

    def get(self, key: int) -> int:
        """What is known of a key."""
        page = self._values.get(key >> _PAGE)
        return 0 if page is None else int(page[key & _REST])

    def keep(self, keys: Words, values: Words) -> None:
        """The values of a batch in their order; the last one of a key stays. A page of 32,768 for each bus."""
        pages = keys >> _PAGE
        for number in np.flatnonzero(np.bincount(pages)).tolist():
            page = self._values.setdefault(number, np.zeros(1 << _PAGE, np.int64))
            here = pages == number
            page[keys[here] & _REST] = values[here]
