"""`ch`: the ESC that a transfer speaks of, as people count them."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from analyzer.devices.as_of import AsOf, ToldValues
from analyzer.devices.escs import CHANNEL
from analyzer.devices.rows import keyed, usable
from analyzer.filter.values import Values
from dissectors import picture
from dissectors.kit.cells import numbers, valid
from dissectors.picture import Who

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.filter.history import SeenBatch
    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.picture import Plot

_NUMBER = (1 << 32) - 1
_MOST = 255


class ChannelsOf:
    """Finds channels: that which a message names, else that which its node has been known as until then.

    Args:
        registry: the types, with what their pictures say of devices.
    """

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._known = AsOf()
        self._fed: object = None

    @cached_property
    def _plots(self) -> tuple[Plot, ...]:
        return tuple(picture.load(self._registry).plots.values())

    def feed(self, context: SeenBatch) -> None:
        """Learn from the next batch which channel nodes say they are."""
        if self._fed is context:
            return
        self._fed = context
        for name in self.tables():
            table = context.batch.messages.get(name)
            if table is None or CHANNEL not in table.schema.names:
                continue
            table = usable(table)
            column = table.column(CHANNEL)
            rows = np.flatnonzero(valid(column))
            node = (numbers(table.column("bus")).astype(np.int64) << 8 | numbers(table.column("src")))[rows]
            place = numbers(table.column("transfer")).astype(np.int64)[rows]
            self._known.feed(ToldValues(node, place, numbers(column)[rows].astype(np.float64), place))

    def tables(self) -> Iterator[str]:
        """Yield the tables in which nodes say which channel they are, or which ESC a row is about."""
        told = (message for profile in self._registry.profiles for message in profile.having("derived"))
        own = [one.table for one in told if any(made.name == CHANNEL for made in one.derived)]
        yield from dict.fromkeys((*own, *(plot.table for plot in self._plots if plot.esc_of)))

    def of(self, context: SeenBatch) -> Values:
        """Return the channel of each transfer of a batch."""
        self.feed(context)
        transfers = context.batch.transfers
        if not len(transfers):
            return Values(None, np.zeros(0, np.int64))
        found, named = np.zeros(len(transfers), np.int64), np.zeros(len(transfers), bool)
        for plot in self._plots:
            if plot.who.elements:
                named |= context.of_type(plot.table)  # speaks of many: of none in particular
            who = Who(column=plot.esc_of, first=1) if plot.esc_of else plot.who
            table = context.batch.messages.get(plot.table) if who.column and who.first == 1 else None
            if table is not None:  # what is broken, and names none, is its node's
                rows, key = keyed(table, who)
                at = (numbers(rows.column("transfer")) - np.uint64(context.batch.first_transfer)).astype(np.int64)
                found[at], named[at] = (key & _NUMBER) + who.first, True
        node = numbers(transfers.column("bus")).astype(np.int64) << 8 | numbers(transfers.column("src"))
        place = np.arange(len(transfers)) + context.batch.first_transfer
        known, told, _ = self._known.ask(node, place)
        other: Array = known & ~named
        found[other] = np.nan_to_num(told[other]).astype(np.int64)
        self._known.forget()
        return Values(None, found, (found > 0) & (found <= _MOST))
