"""The name of a capture alone: `tailbyte crash.log` is `tailbyte triage crash.log`."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Container, Sequence

_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]+://")  # as in analyzer.sources.storage, which is heavier


def triaged(words: Sequence[str], commands: Container[str]) -> Sequence[str]:
    """Return what was typed, with the command that a capture alone stands for.

    A command wins over a file of its name, and a command behind the file is a slip that somebody else speaks of.
    """
    first = words[0]
    if first in commands or first.startswith("-") or any(word in commands for word in words[1:]):
        return words
    if _ADDRESS.match(first):
        return ["triage", *words]
    if os.path.lexists(first) and not os.path.isdir(first):  # noqa: PTH112 - any bytes
        return ["triage", *words]
    return words
