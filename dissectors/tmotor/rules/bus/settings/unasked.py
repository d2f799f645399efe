"""ParamGet without a ParamCfg before it (4.4.6)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Rule, all_resumed, usable
from dissectors.tmotor.rules.joined.joins import end

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, Occurrences, View


class Unasked(Rule):
    """Compares each ParamGet with the last ParamCfg of its bus, a damaged one too."""

    rules = ("BUS-014",)

    def __init__(self) -> None:
        self._asked: dict[int, int] = {}  # by bus: end of the last ParamCfg

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Yield those that nothing was asked before, as far as the capture can tell."""
        if view.start == NO_TIME:
            return
        settings, parameters = view.table("ParamCfg"), view.table("ParamGet")
        if parameters is not None:
            window = view.number("BUS-014", "window_s")
            long = round(window * SECOND)
            rows = np.flatnonzero(usable(parameters) & (parameters.t != NO_TIME))
            t, asked = parameters.t[rows], self._before(view, settings, parameters, rows)
            begins = all_resumed(view, t)
            for bus, start in view.starts.items():
                begins = np.where(parameters.bus[rows] == bus, np.maximum(begins, start), begins)
            found = (t - begins >= long) & ((asked == NO_TIME) | (t - asked > long))
            if found.any():
                yield view.among_rows(
                    "BUS-014", parameters, rows[found], lambda _: {"window_s": window}, drops=True,
                    since=t[found] - long, each_named=True,
                )  # fmt: skip
        if settings is not None:
            self._asked |= dict(
                zip(settings.bus.tolist(), end(view, settings, np.arange(len(settings))).tolist(), strict=True)
            )

    def _before(self, view: View, settings: DecodedTable | None, table: DecodedTable, rows: Array) -> Array:
        """Return the end of the last ParamCfg before each row, `NO_TIME` if there was none."""
        found = np.full(len(rows), NO_TIME)
        for bus in np.unique(table.bus[rows]).tolist():
            mine, times = np.flatnonzero(table.bus[rows] == bus), np.array([self._asked.get(bus, NO_TIME)])
            at = np.zeros(len(mine), np.int64)
            if settings is not None:
                asks = np.flatnonzero(settings.bus == bus)
                at = np.searchsorted(settings["transfer"][asks], table["transfer"][rows[mine]])
                times = np.append(times, end(view, settings, asks))
            found[mine] = times[at]
        return found
