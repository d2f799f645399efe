"""Checks of single fields, made from the `tests` of pages."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.rules.catalogue import Page
    from dissectors import Registry
    from dissectors.conformance import Watcher


def made(_registry: Registry, _pages: Mapping[str, Page]) -> Iterator[Watcher]:
    """A watcher for each test of a page."""
    yield from ()
