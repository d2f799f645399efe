"""What people read: every page of the repository, cut into its blocks of code and its words in code type."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

import analyzer

ROOT = Path(analyzer.__file__).parents[1]
MANUAL = ROOT / "analyzer" / "manual"
FOLDERS = ("", "analyzer/", "dissectors/", "captures/", "tests/")
PAGES = [*(path for folder in FOLDERS if (path := ROOT / f"{folder}README.md").exists()), *sorted(MANUAL.glob("*.md"))]

_FENCE = re.compile(r"^( *)```(\w*)\n(.*?)^\1```$", re.DOTALL | re.MULTILINE)
_PLACE = re.compile(r"# ((?:\w+/)+[\w.]+)(?:, in (\w+))?\n")


@dataclass(frozen=True)
class Block:
    """A block of code. `kind` is the language that stands behind its fence."""

    kind: str
    text: str

    @property
    def place(self) -> tuple[str, str] | None:
        """Where it belongs, if its first line says so: a new file, or a file and a table in it."""
        found = _PLACE.match(self.text)
        return None if found is None else (found[1], found[2] or "")

    def lines(self) -> list[str]:
        """The commands of a shell, without comments, those over several lines joined."""
        lines = self.text.replace("\\\n", " ").splitlines()
        return [line for line in lines if shlex.split(line, comments=True)]


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def blocks(page: Path) -> list[Block]:
    return blocks_of(page.read_text())


def blocks_of(text: str) -> list[Block]:
    found = _FENCE.findall(text)
    return [Block(kind, re.sub(f"^{margin}", "", code, flags=re.MULTILINE)) for margin, kind, code in found]


def prose(page: Path) -> str:
    """The page without its blocks of code."""
    return _FENCE.sub("", page.read_text())


def spans(page: Path) -> list[str]:
    """What stands in code type among the words."""
    return [" ".join(span.replace(r"\|", "|").split()) for span in re.findall(r"`([^`]+)`", prose(page))]
