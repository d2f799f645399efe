"""Captures as text, compared."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import pytest

import analyzer

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer import CaptureDiff

    Compare = Callable[..., CaptureDiff]


@pytest.fixture(scope="module")
def compare(tmp_path_factory: pytest.TempPathFactory) -> Compare:
    """Compares two texts, each two of them once."""
    folder = tmp_path_factory.mktemp("pairs")

    @cache
    def run(good: str, bad: str, ignore: str = "") -> CaptureDiff:
        paths = folder / "good.log", folder / "bad.log"
        for path, text in zip(paths, (good, bad), strict=True):
            path.write_text(text)
        return analyzer.diff(*paths, ignore=[ignore] if ignore else [])

    return run
