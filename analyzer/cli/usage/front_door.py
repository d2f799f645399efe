"""The name of a capture alone: `tailbyte crash.log` is `tailbyte triage crash.log`."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Container, Sequence


def triaged(words: Sequence[str], commands: Container[str]) -> Sequence[str]:
    """Return what was typed, with the command that a capture alone stands for.

    A command wins over a file of its name, and a command behind the file is a slip that somebody else speaks of.
    """
    first = words[0]
    if first in commands or first.startswith("-") or any(word in commands for word in words[1:]):
        return words
    if os.path.lexists(first) and not os.path.isdir(first):  # noqa: PTH112 - any bytes
        return ["triage", *words]
    return words
