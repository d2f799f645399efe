"""The CAN interfaces that the kernel has, read where it shows them: python-can would take its time."""

from __future__ import annotations

import os
from contextlib import suppress

_FOLDER = "/sys/class/net"
_CAN = b"280"  # ARPHRD_CAN


def interfaces(folder: str = _FOLDER) -> list[str]:
    """Return their names, sorted; none where the kernel shows none."""
    found = []
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            with suppress(OSError), open(f"{entry.path}/type", "rb") as file:  # noqa: PTH123 - pathlib takes too long
                if file.read().strip() == _CAN:
                    found.append(entry.name)
    return sorted(found)
