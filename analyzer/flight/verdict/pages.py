"""The pages of verdicts, for `explain`."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Mapping

VERDICTS = (
    "esc", "propulsion", "thrust", "control", "setup", "commanded", "commands-lost", "wiring", "bus", "battery",
    "recorder", "address", "device", "none", "unknown",
)  # fmt: skip
FILE = Path(__file__).with_name("pages.toml")
LABELS = {"speaks": "For it", "against": "Against", "near": "Near", "next": "Next"}


@dataclass(frozen=True, slots=True)
class VerdictPage:
    """The page of a kind of verdict: what speaks for it, against it, what looks like it, what to do next."""

    title: str
    means: str
    speaks: str
    against: str
    near: str
    next: str


@cache
def verdict_pages() -> Mapping[str, VerdictPage]:
    """Return the pages of `VERDICTS`, by kind."""
    import tomllib  # noqa: PLC0415 - only for who reads a page

    return {kind: VerdictPage(**page) for kind, page in tomllib.loads(FILE.read_text(encoding="utf-8")).items()}
