"""The comparison of two checkouts ends, and says what is dearer. How long things take is not tested."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from bench import guard
from kit import ROOT

GUARD = Path(guard.__file__)


def test_the_table_says_what_new_takes_of_old() -> None:
    assert guard.table(["check"], {"check": 2.0}, {"check": 0.5}, "s").splitlines()[1].split() == [
        "check", "2.000s", "0.500s", "0.25x",
    ]  # fmt: skip


@pytest.mark.slow
def test_a_checkout_beside_itself() -> None:
    small = ("--frames", "500", "--runs", "1")
    done = subprocess.run(
        [sys.executable, GUARD, ROOT, ROOT, *small, "--limit", "10000"], capture_output=True, text=True, check=True
    )
    assert len(done.stdout.splitlines()) == 8
    done = subprocess.run(
        [sys.executable, GUARD, ROOT, ROOT, *small, "--limit", "-99"], capture_output=True, check=False
    )
    assert done.returncode == 1
