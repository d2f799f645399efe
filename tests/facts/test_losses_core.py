"""Transfers that did not come, as the core counts them row by row: the same as in columns, wherever batches begin."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest
from kit.losses_in_columns import LossesInColumns

from analyzer import _native
from analyzer.facts.losses import LostTransfers
from analyzer.tables import TRANSFER_ANOMALIES, TRANSFERS
from dissectors.times import SECOND

GAP, TO_ZERO = (1 << TRANSFER_ANOMALIES.index(name) for name in ("transfer id gap", "transfer id restarted"))
NODES = (1, 2, 3, 130)


def batches(seed: int, *, common: bool) -> list[pa.RecordBatch]:
    """Return transfers of a few nodes that lose some, begin anew, wrap early, come in another order."""
    rng = np.random.default_rng(seed)
    counters: dict[object, int] = {}
    known: dict[object, int] = {}
    found, t = [], 0
    for _ in range(12):
        rows = []
        for _ in range(int(rng.integers(1, 120))):
            node, type_id, kind = int(rng.choice(NODES)), int(rng.integers(1, 4)), int(rng.choice([0, 0, 0, 1, 2, 3]))
            of = node if common else (node, type_id, kind)
            counters[of] = counters.get(of, int(rng.integers(32))) + 1
            if rng.random() < 0.1:
                counters[of] += int(rng.integers(1, 34))
            if rng.random() < 0.05 or (node == 3 and counters[of] % 32 == 7):
                counters[of] = 0
            now, session = counters[of] % 32, (node, type_id, kind)
            step = (now - known.get(session, now - 1)) % 32
            known[session] = now
            flaw = 0 if step == 1 else TO_ZERO if now == 0 else GAP
            t += int(rng.integers(-50, 400)) * SECOND // 1000
            row = dict.fromkeys(TRANSFERS.names, 0) | {"frame": [], "payload": b"", "fd": False}
            row |= {"t": t if rng.random() < 0.95 else None, "bus": int(node == 2), "src": node, "kind": kind}
            row |= {"dst": 9 if kind > 1 else 0, "type_id": type_id, "transfer_id": now, "step": step, "anomaly": flaw}
            rows.append(row)
        found.append(pa.RecordBatch.from_pylist(rows, TRANSFERS))
    return found


def compare(some: list[pa.RecordBatch]) -> list[int | None]:
    core, columns = LostTransfers(), LossesInColumns()
    for batch in some:
        core.feed(batch)
        columns.feed(batch)
    told = []
    for at in ((bus, node) for bus in (0, 1) for node in NODES):
        sums = [columns._count(name, at) for name in ("lost", "common", "by_both", "gaps", "returns", "types")]
        assert list(core._sums(at)) == [*sums, columns._zeroed.lost[at]]
        assert core.shared(at) == columns.shared(at)
        told += [core.lost(at, began_anew=anew) for anew in (False, True)]
        assert told[-2:] == [columns.lost(at, began_anew=anew) for anew in (False, True)]
    return told


@pytest.mark.parametrize("seed", range(12))
def test_the_core_counts_the_same(seed: int) -> None:
    assert any(compare(batches(seed, common=seed % 3 == 0)))


def test_columns_fit_together() -> None:
    columns = [np.zeros(2, kind) for kind in ("i8", "u1", "u1", "u1", "u1", "u2", "u1", "u1", "u4")]
    with pytest.raises(ValueError, match="do not fit"):
        _native.Losses().feed((*columns[:-1], np.zeros(3, np.uint32)))
