"""The benchmarks end and fill their tables. How long things take is not tested."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from bench import growth, live, run
from bench.cost import Cost, Row

from analyzer.decode.engine import Engine

if TYPE_CHECKING:
    from collections.abc import Callable


def test_a_row_is_the_median_of_its_runs() -> None:
    costs = [Cost(3.0, 1.0, 10_000_000), Cost(1.0, 9.0, 30_000_000), Cost(2.0, 4.0, 20_000_000)]
    row = Row("check", 1_000_000, lambda: costs[0], costs)
    assert run.table([row], 4000.0).splitlines()[1].split() == ["check", "500,000", "2,000.0", "4,000.0", "2.0", "30"]


@pytest.mark.slow
@pytest.mark.parametrize(("make", "count"), [(growth.on_interfaces, 3), (growth.of_types, 5)])
def test_what_grows_in_a_log(make: Callable[..., Path], count: int, tmp_path: Path) -> None:
    (batch,) = Engine().run([make(tmp_path, count, frames=600).read_bytes()])
    column = "bus" if make is growth.on_interfaces else "type_id"
    assert len(batch.frames) == 600
    assert len(set(batch.transfers.column(column).to_pylist())) == count


@pytest.mark.slow
def test_one_frame_in_so_many_is_damaged(tmp_path: Path) -> None:
    flight, log = (growth.damaged(tmp_path, every, frames=600).read_text().splitlines() for every in (0, 2))
    differs = [one.split() != two.split() for one, two in zip(flight, log, strict=True)]
    assert differs == [True, False] * 300


@pytest.mark.slow
def test_faults_come_evenly_to_a_live_bus(tmp_path: Path) -> None:
    log = live.frames(live.faulty(tmp_path / "mixed.log", "mixed", 0.1))
    assert [round(t * live.FULL) for t, _ in log] == list(range(760))
    assert {bool(live.FRAME.unpack(frame)[0] & live.EXTENDED) for _, frame in log} == {False, True}


@pytest.mark.slow
def test_every_row_is_measured() -> None:
    small = ("--frames", "500", "--faulty", "0", "--runs", "1")
    done = subprocess.run([sys.executable, Path(run.__file__), *small], capture_output=True, text=True, check=True)
    for name in ("wc -l", run.ENGINE, "check --threads 1", "decode -V", run.REFERENCE):
        assert any(line.startswith(name) for line in done.stdout.splitlines())
