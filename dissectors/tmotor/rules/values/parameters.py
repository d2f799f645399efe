"""ParamCfg and ParamGet: IDs, queries, doubtful values, lifetime counters, dates (4.4.2, 4.4.6). Both are rare."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import Rule, breach, rule, usable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, Occurrence, Occurrences, Values, View

_QUERY = b"\xff" * 27
# Fields of ParamCfg with 16 bits; the UUID is the only one with 32.
_WORDS = (
    "esc_id_set", "esc_ov_threshold", "esc_oc_threshold", "esc_ot_threshold", "esc_acc_threshold",
    "esc_dacc_threshold", "esc_rotate_dir", "esc_led_mode", "esc_fdb_rate",
)  # fmt: skip
_PARTLY_ONES = (0xFF, 0xFFFF, 0xFFFFFF)  # masks of the low bytes of a 32-bit field
_MOST_ID = 19  # 4.4.2 no 1
_ALL_IDS = (0xFF, 0xFFFF)  # 4.4.6 no 6-7
_RESERVED = (0, 32)
_COUNTERS = ("esc_startup_times", "esc_startup_duration", "esc_error_count")
_NEARLY_FULL, _JUST_BEGUN = 65_000, 500  # of 16 bits
_MOST_DEVICES = 4096
_YEARS = range(1990, 2100)
_SECONDS_FROM = 946_684_800  # 2000-01-01


@rule("TYP-202")
def ids(view: View) -> Iterator[Occurrences]:
    """Find IDs above 19, unless the index beside them says the same (4.4.2 no 6-7, 4.4.6 no 6-7)."""
    for name, field in (("ParamCfg", "esc_id_set"), ("ParamGet", "esc_id_req")):
        table = view.table(name)
        if table is None:
            continue
        number = table[field]
        rows = (usable(table) & (number > _MOST_ID)).nonzero()[0]
        if rows.size:
            rows = rows[~np.isin(number[rows], _ALL_IDS)]
        if rows.size and name == "ParamGet":
            rows = rows[number[rows] != table["esc_index"][rows]]
        if rows.size:

            def values_of(row: int, field: str = field, number: Array = number) -> Values:
                return {"field": field, "value": int(number[row])}

            yield view.among_rows("TYP-202", table, rows, values_of)


@rule("TYP-208")
def queries(view: View) -> Iterator[Occurrences]:
    """Find ParamCfg of 27 bytes 0xFF (4.4.2 expl. 2)."""
    table = view.table("ParamCfg")
    if table is None:
        return
    rows = usable(table).nonzero()[0].tolist()
    asked = [row for row in rows if view.transfers.payload(int(table.row[row]))[: len(_QUERY)] == _QUERY]
    if asked:
        yield view.among_rows("TYP-208", table, np.array(asked), lambda row: {"node": int(table.src[row])})


@rule("TYP-209")
def ambiguous(view: View) -> Iterator[Occurrences]:
    """Find values that could mean no change (4.4.2 expl. 1)."""
    table = view.table("ParamCfg")
    if table is None:
        return
    good, uuid = usable(table), table["esc_uuid"]
    if not good.any():
        return
    partly = np.zeros(len(table), bool)
    for mask in _PARTLY_ONES:
        partly |= uuid & mask == mask
    doubtful = [("esc_uuid", partly & (uuid != 0xFFFFFFFF)), *((name, table[name] == 0xFF) for name in _WORDS)]
    for name, wrong in doubtful:
        rows = (wrong & good).nonzero()[0]
        if rows.size:

            def values_of(row: int, name: str = name) -> Values:
                return {"field": name, "value": int(table[name][row])}

            yield view.among_rows("TYP-209", table, rows, values_of)


@rule("TYP-401")
def reserved(view: View) -> Iterator[Occurrences]:
    """Find a reserved block that is neither left out nor whole (4.4.6 no 42-73)."""
    table = view.table("ParamGet")
    if table is None:
        return
    starts, _ = table.lists("rsvd")
    length = np.diff(starts)
    rows = (usable(table) & (length != _RESERVED[0]) & (length != _RESERVED[1])).nonzero()[0]
    if rows.size:
        yield view.among_rows("TYP-401", table, rows, lambda row: {"length": int(length[row])}, key=length[rows])


class Lifetime(Rule):
    """Counters that only grow, by bus and UUID; `_MOST_DEVICES` of them."""

    rules = ("TYP-402",)

    def __init__(self) -> None:
        self._before: dict[tuple[int, int], dict[str, int]] = {}

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Compare each report with the one before it."""
        table = view.table("ParamGet")
        if table is None:
            return
        devices = list(zip(table.bus.tolist(), table["esc_uuid"].tolist(), strict=True))
        counts = list(zip(*(table[name].tolist() for name in _COUNTERS), strict=True))
        for row in usable(table).nonzero()[0].tolist():
            device, now = devices[row], dict(zip(_COUNTERS, counts[row], strict=True))
            before = self._before.get(device, now)
            if device in self._before or len(self._before) < _MOST_DEVICES:
                self._before[device] = now
            for name, value in now.items():
                wrapped = name == "esc_startup_times" and before[name] > _NEARLY_FULL and value < _JUST_BEGUN
                if value < before[name] and not wrapped:
                    values = {"field": name, "before": before[name], "value": value}
                    yield breach(view, table, row, "TYP-402", values)


@rule("TYP-404")
def dates(view: View) -> Iterator[Occurrences]:
    """Find how the production date reads (4.4.6 no 27-30 names no format)."""
    table = view.table("ParamGet")
    if table is None:
        return
    date, rows = table["esc_product_date"], usable(table).nonzero()[0]
    by_row = {row: {"value": int(date[row]), "format": _format(int(date[row]))} for row in rows.tolist()}
    key = np.array([one["format"] for one in by_row.values()])
    if by_row:
        yield view.among_rows("TYP-404", table, rows, by_row.__getitem__, key=key)


def _format(value: int) -> str:
    try:
        if datetime(value // 10_000, value // 100 % 100, value % 100, tzinfo=UTC).year in _YEARS:
            return "YYYYMMDD"
    except ValueError:
        pass
    return "seconds since 1970" if value >= _SECONDS_FROM else "unknown"
