"""The content of the TOML files of this distribution, parsed before it is shipped: that is a third of what they cost.

`parsed.jsonl` has a line for each of them: the SHA-256 of its text, its name and what it says. A text with another hash
is parsed when it is read, as those of other folders are. `tests/bench/parse_toml.py` writes the file.
"""

from __future__ import annotations

import json
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

FILE = Path(__file__).parents[1] / "parsed.jsonl"


def known(text: bytes) -> dict[str, Any] | None:
    """Return what a TOML text says, anew each time; None if it is no file of this distribution."""
    said = _lines().get(sha256(text).hexdigest().encode())
    return None if said is None else dict(json.loads(said))


def line(name: str, text: bytes, said: dict[str, Any]) -> str:
    """Return the line of a file. What JSON would change is no table of ours (`ValueError`)."""
    body = json.dumps(said, ensure_ascii=False, separators=(",", ":"))
    if json.loads(body) != said:
        raise ValueError(f"{name}: JSON cannot say this")
    return f"{sha256(text).hexdigest()} {name} {body}\n"


@cache
def _lines() -> dict[bytes, bytes]:
    try:
        whole = FILE.read_bytes()
    except OSError:
        return {}  # a tree in which it was never written
    split = (one.split(b" ", 2) for one in whole.splitlines())
    return {parts[0]: parts[2] for parts in split if len(parts) == 3}
