"""A recorder's statement about itself, a comment in front of what it records: which losses would be in it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from analyzer.tables import EVENTS
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    import pyarrow as pa

DROPS, ERRORS = "drops", "error frames"
_COMMENT = EVENTS.index("comment")
_STATED = re.compile(rf"#?\s*recorded with ((?:{DROPS}|{ERRORS}|, ){{1,3}})")
# Comments of a batch that are looked at.
_MOST = 16


def statement(*, drops: bool, errors: bool) -> str:
    """Return the comment: whether drops would be counted in the recording, and error frames stand in it.

    Empty for neither.
    """
    words = [word for word, said in ((DROPS, drops), (ERRORS, errors)) if said]
    return f"recorded with {', '.join(words)}" if words else ""


def stated(events: pa.RecordBatch) -> set[str]:
    """Return what the first comments of a batch say: of `DROPS` and `ERRORS` those that would be there."""
    found: set[str] = set()
    kinds = numbers(events.column("kind"))
    for row in (kinds == _COMMENT).nonzero()[0][:_MOST].tolist():
        match = _STATED.fullmatch(events.column("text")[row].as_py() or "")
        found |= set(match[1].split(", ")) if match else set()
    return found
