"""Columns of the core are looked at where they lie: they outlive it, and nobody can write to them."""

from __future__ import annotations

import gc

import numpy as np
import pytest

from analyzer import _native
from analyzer.tables import TRANSFERS, wrap

LINES = [b"(1700000000.000000) can0 1E04060A#001122334455%02X%02X\n" % (n % 251, 0xC0 | n % 32) for n in range(1000)]


def pipeline() -> _native.Pipeline:
    return _native.Pipeline(lambda *_: [])


def taken() -> tuple:
    core = pipeline()
    core.feed(b"".join(LINES))
    core.finish()
    return core.take()


def test_columns_outlive_the_core() -> None:
    (_, transfers, *_), _ = taken()
    table = wrap(TRANSFERS, transfers)
    cells = np.frombuffer(transfers["frame"], np.uint64)
    del transfers
    gc.collect()
    taken()  # whatever was freed is in use again
    assert cells.tolist() == list(range(1000))
    assert table.column("payload").to_pylist() == [bytes.fromhex(f"001122334455{n % 251:02x}") for n in range(1000)]
    table.validate(full=True)


def test_nobody_can_write_to_them() -> None:
    (frames, *_), _ = taken()
    view = memoryview(frames["id"])
    assert view.readonly
    assert len(view) == len(frames["id"]) == 4000
    with pytest.raises(ValueError, match="read-only"):
        np.frombuffer(frames["id"], np.uint32)[0] = 1


def test_a_column_without_cells_has_no_bytes() -> None:
    (frames, transfers, *_), _ = pipeline().take()
    assert bytes(frames["data"]) == bytes(transfers["frame"]) == b""
    assert bytes(transfers["frame_offset"]) == bytes(4)
