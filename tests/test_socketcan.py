"""What needs a kernel with SocketCAN runs in a guest of its own, one for all of it (`socketcan/socketcan-vm`)."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from command import ROOT, environment

HERE = Path(__file__).parent / "socketcan"
NO_GUEST = 125
LIMIT = 600


@pytest.mark.timeout(LIMIT + 60)
def test_on_socketcan() -> None:
    inside = sorted(HERE.glob("guest_*.py"))
    assert inside
    tests = [
        sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-o", "addopts=--import-mode=importlib",
        "-o", f"pythonpath={HERE.parent} {HERE}", "--rootdir", HERE.parent, *inside,
    ]  # fmt: skip
    command = ["bash", HERE / "socketcan-vm", "--timeout", str(LIMIT), "--", *tests]
    done = subprocess.run(command, cwd=ROOT, env=environment(), capture_output=True, check=False, text=True)
    if done.returncode == NO_GUEST:
        pytest.skip(f"no guest: {done.stderr.strip().splitlines()[-1]}")
    assert done.returncode == 0, done.stdout + done.stderr
