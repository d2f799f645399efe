"""Captures that several commands are tried on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit.command import HOVER, commands, log

if TYPE_CHECKING:
    from pathlib import Path

MS = 1_000_000


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """Ten frames, one a millisecond."""
    path = tmp_path / "small.log"
    path.write_bytes(log(commands(*range(0, 10 * MS, MS))))
    return path


@pytest.fixture
def large(tmp_path: Path) -> Path:
    """Several pieces of rows."""
    path = tmp_path / "large.log"
    path.write_bytes(HOVER.read_bytes() * (1 + 3_000_000 // HOVER.stat().st_size))
    return path
