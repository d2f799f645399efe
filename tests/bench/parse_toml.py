"""Writes `dissectors/parsed.jsonl`: what the TOML files of dissectors, rules and flights say.

To be run when one has changed:

    python tests/bench/parse_toml.py
"""

from __future__ import annotations

import tomllib
from pathlib import Path

from dissectors.keys import parsed

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("analyzer/flight", "analyzer/rules", "dissectors")


def lines(root: Path = ROOT) -> str:
    """Return the file as it has to be."""
    files = sorted(path for folder in FOLDERS for path in (root / folder).rglob("*.toml"))
    texts = ((path.relative_to(root).as_posix(), path.read_bytes()) for path in files)
    return "".join(parsed.line(name, text, tomllib.loads(text.decode())) for name, text in texts)


if __name__ == "__main__":
    parsed.FILE.write_text(lines(), encoding="utf-8")
