"""Array lengths that classic CAN leaves out (5.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.kit import rule, usable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, Occurrences, Values, View

_WHOLE_BYTE = 2  # layout code; 1 is the prefix of the DSDL
# Arrays at the end of types, by the bits of the length that the DSDL gives them.
_TAILS = {"RawCommand": ("cmd", 5), "PUSHSCI": ("data", 8), "PUSHCAN": ("data", 8), "ParamGet": ("rsvd", 6)}


@rule("TYP-006")
def prefixes(view: View) -> Iterator[Occurrences]:
    """Find array lengths that classic CAN leaves out (5.3)."""
    for name, (field, width) in _TAILS.items():
        table = view.table(name)
        if table is None or not table["layout"].any():
            continue
        mine = ((table["layout"] != 0) & usable(table)).nonzero()[0]
        mine = mine[~view.transfers.fd[table.row[mine]]]
        if mine.size:
            yield _prefix_breaches(view, table, mine, field, width)


def _prefix_breaches(view: View, table: DecodedTable, rows: Array, field: str, width: int) -> Occurrences:
    layout, (starts, _) = table["layout"], table.lists(field)

    def values(row: int) -> Values:
        whole = layout[row] == _WHOLE_BYTE or width == 8
        form = "whole-byte" if whole else f"{width}-bit"
        return {"form": form, "prefix": int(starts[row + 1] - starts[row])}

    return view.among_rows("TYP-006", table, rows, values, key=layout[rows])
