"""What needs a kernel with SocketCAN runs in a guest of its own, one for all of it (`socketcan/socketcan-vm`)."""

from __future__ import annotations

import subprocess
import sys

import pytest
from kit import ROOT, TESTS
from kit.command import environment

HERE = TESTS / "socketcan"
NO_GUEST = 125
HANGS = 3 * 3600  # seconds; a quiet machine needs some three minutes


@pytest.mark.slow
@pytest.mark.timeout(HANGS + 600)
def test_on_socketcan() -> None:
    tests = [
        sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-n0", "-o", f"timeout={HANGS}",
        "--rootdir", HERE.parent, HERE,
    ]  # fmt: skip
    command = ["bash", HERE / "socketcan-vm", "--timeout", str(HANGS), "--", *tests]
    done = subprocess.run(command, cwd=ROOT, env=environment(), capture_output=True, check=False, text=True)
    if done.returncode == NO_GUEST:
        pytest.skip(f"no guest: {done.stderr.strip().splitlines()[-1]}")
    assert done.returncode == 0, done.stdout + done.stderr
