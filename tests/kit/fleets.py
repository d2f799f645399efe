"""A handful of captures, good and bad, and what a store says of them without what differs from run to run."""

from __future__ import annotations

import gzip
from typing import TYPE_CHECKING, Any

import pytest

from analyzer.fleet.jobs import FleetSettings, Retries
from analyzer.fleet.tables import TABLES
from kit import CAPTURES

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from analyzer.fleet.store import ResultStore

GOOD = ("hover", "hover-4", "bus-break", "duplicate-node", "control-lost", "faults")
SETTINGS = FleetSettings()
QUICK = Retries(2, 0.01)
OF_A_RUN = {"run", "attempts", "cpu_s", "at_ns"}


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """Return a folder: some captures, packed and not, one twice, one cut, garbage, and an empty one."""
    folder = tmp_path / "logs"
    folder.mkdir()
    for number, name in enumerate(GOOD):
        data = (CAPTURES / f"{name}.log").read_bytes()
        (folder / f"v{number}_{name}.log.gz").write_bytes(gzip.compress(data, 1, mtime=0))
    hover = gzip.compress((CAPTURES / "hover.log").read_bytes(), 1, mtime=0)
    (folder / "v0_again.log.gz").write_bytes(hover)
    (folder / "v1_cut.log.gz").write_bytes(hover[: len(hover) // 2])
    (folder / "v2_garbage.log.gz").write_bytes(bytes(range(128, 256)) * 20)
    (folder / "v3_empty.log.gz").write_bytes(b"")
    return folder


@pytest.fixture
def checked(logs: Path, tmp_path: Path, command: Callable[..., tuple[int, str, str]]) -> tuple[Path, list[Any]]:
    """Return the store of those that are packed, checked, and the arguments of that."""
    place = tmp_path / "results"
    arguments = ["fleet", "check", logs / "*.gz", "-o", place, "--name", "{vehicle}_*.log.gz", "--workers", "0"]
    status, _, said = command(*arguments)
    assert status == 3, said  # garbage has no result
    return place, arguments


def content(store: ResultStore) -> dict[str, list[tuple[Any, ...]]]:
    """Return the rows that count of every table but `runs`, sorted, without what differs from run to run."""
    answers = store.connected()
    found = {}
    for name, schema in TABLES.items():
        if name != "runs":
            columns = ", ".join(f'"{one}"' for one in schema.names if one not in OF_A_RUN)
            found[name] = sorted(answers.execute(f"select {columns} from {name}").fetchall(), key=repr)
    return found
