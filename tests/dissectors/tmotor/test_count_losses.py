"""What explains a jump in frame counts: transfers that were lost between two others, whenever they come out."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.tmotor.rules.packets.carried import TYPE_IDS
from dissectors.tmotor.rules.packets.losses import TransferLosses

if TYPE_CHECKING:
    from dissectors.kit import View

NODE = 1 << 7 | 42  # with the bus
TOLD = st.tuples(st.integers(0, 40), st.integers(0, 3), st.integers(0, 5).map(lambda code: int(code == 0)))


def _view(rows: list[tuple[int, int, int]]) -> View:
    """Return a batch of PUSHCAN: first frames, steps, and statuses, 0 for intact."""
    lead, step, status = np.array(rows, np.int64).reshape(-1, 3).T
    same = {
        name: np.full(len(rows), value)
        for name, value in (("type_id", TYPE_IDS["PUSHCAN"]), ("kind", 0), ("bus", NODE >> 7), ("src", NODE & 0x7F))
    }
    known = np.ones(len(rows), bool)
    transfers = SimpleNamespace(lead=lead, step=step, status=status, has=lambda _name: known, **same)
    return cast("View", SimpleNamespace(transfers=transfers, table=lambda _name: None))


@given(st.lists(st.lists(TOLD, max_size=8), max_size=4), st.integers(-1, 41), st.integers(-1, 41), st.integers(0, 6))
def test_losses_explain_what_lies_between(
    batches: list[list[tuple[int, int, int]]], since: int, until: int, missing: int
) -> None:
    losses = TransferLosses()
    for rows in batches:
        losses.feed(_view(rows))
    between = [row for rows in batches for row in rows if since < row[0] <= until]
    lost = sum(step - 1 for _, step, _ in between if step > 1)
    wanted = any(status for _, _, status in between)
    if not wanted:
        wanted = 0 < missing <= lost
    assert losses.explain("PUSHCAN", NODE, (since, until), missing) == wanted
