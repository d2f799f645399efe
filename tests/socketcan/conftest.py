"""What is here runs in the guest only, which `test_socketcan.py` boots."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable

    Command = Callable[..., tuple[int, str, str]]

collect_ignore_glob = [] if os.environ.get("SOCKETCAN_VM") else ["test_*.py"]
LATE = "-- this machine was too slow: "


@pytest.fixture
def command(command: Command) -> Command:
    """Leave out that a machine was too slow for what it sent: that may be said anywhere."""

    def call(*args: object) -> tuple[int, str, str]:
        status, out, err = command(*args)
        return status, out, "".join(line for line in err.splitlines(keepends=True) if not line.startswith(LATE))

    return call
