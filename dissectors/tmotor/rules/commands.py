"""Rules."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dissectors.conformance import Watcher

WATCHERS: tuple[type[Watcher], ...] = ()
