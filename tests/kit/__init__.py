"""What the tests share, and where things are."""

from __future__ import annotations

from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
ROOT = TESTS.parent
CAPTURES = ROOT / "captures"
VECTORS = TESTS / "vectors"
