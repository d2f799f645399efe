"""How many rows make a batch: fewer where much is wrong, as such rows take more room."""

from __future__ import annotations

import pytest

from analyzer.decode.core import BATCH_ROWS
from analyzer.decode.engine import Engine

ROWS = 3 * BATCH_ROWS
PIECE = 1 << 18  # bytes
STATUS = "1001550A"  # NodeStatus of node 10


def lengths(loose: int) -> list[int]:
    """Frames of each batch of a log whose every `loose`th frame ends a transfer that never began; 0 for none."""
    engine, lines = Engine(), []
    for row in range(ROWS):
        tail = 0x40 if loose and row % loose == 0 else 0xC0 | row % 32
        lines.append(f"({row // 100}.{row % 100:02}0000) can0 {STATUS}#00000000000000{tail:02X}\n")
    text = "".join(lines).encode()
    batches = list(engine.run(text[at : at + PIECE] for at in range(0, len(text), PIECE)))
    assert engine.totals.verdicts["orphan"] == (-(-ROWS // loose) if loose else 0)
    return [len(batch.frames) for batch in batches if len(batch.frames)]


@pytest.mark.parametrize(("loose", "most"), [(0, BATCH_ROWS), (100, BATCH_ROWS), (16, BATCH_ROWS // 2)])
def test_a_batch_is_half_as_long_where_many_frames_belong_to_no_transfer(loose: int, most: int) -> None:
    *full, rest = lengths(loose)
    assert sum(full) + rest == ROWS
    assert all(most <= one < most * 1.2 for one in full)
    assert rest < most * 1.2
