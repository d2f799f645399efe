"""The pages of verdicts, for `explain`."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Mapping

FILE = Path(__file__).with_name("pages.toml")
LABELS = {"speaks": "For it", "against": "Against", "near": "Near", "next": "Next"}


@dataclass(frozen=True, slots=True)
class VerdictPage:
    """What a kind of verdict means: what speaks for it, against it, what looks like it, what to do next."""

    title: str
    means: str
    speaks: str
    against: str
    near: str
    next: str


@cache
def verdict_pages() -> Mapping[str, VerdictPage]:
    """Return the pages by kind."""
    return {kind: VerdictPage(**page) for kind, page in tomllib.loads(FILE.read_text(encoding="utf-8")).items()}
