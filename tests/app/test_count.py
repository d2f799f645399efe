"""A capture read for its account alone: the same sums, complaints and state as with all its messages."""

from __future__ import annotations

import gzip
from typing import TYPE_CHECKING

import pytest
from kit.command import CAPTURES, HOVER

from analyzer.app.request import Request
from analyzer.app.run import Run

if TYPE_CHECKING:
    from pathlib import Path


def account(path: Path, threads: int, *, messages: bool) -> tuple[object, ...]:
    complaints: list[str] = []
    with Run(Request((str(path),), threads=threads), complaints.append) as run:
        if messages:
            for _ in run.batches():
                pass
        else:
            run.count()
    return run.totals, run.engine.totals, run.engine.stamps, run.engine.buses, run.transfers, run.state, complaints


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("name", ["mission-8-faults.log", "esc-failure.mcap", "broken.log.gz", "empty.log"])
def test_the_account_is_that_of_a_decoded_capture(name: str, threads: int, tmp_path: Path) -> None:
    path = CAPTURES / name
    if not path.exists():
        path = tmp_path / name
        lines = HOVER.read_bytes().splitlines(keepends=True)
        lines[5::41] = [b"no frame\n"] * len(lines[5::41])
        path.write_bytes(gzip.compress(b"".join(lines))[:-2000] if name.startswith("broken") else b"")
    assert account(path, threads, messages=False) == account(path, 1, messages=True)
