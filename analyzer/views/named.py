"""The rules that name a row of a list, as a view shows them."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.filter.memory import NamesFrames


def rules_of(named: NamesFrames | None, rows: Sequence[Sequence[int]]) -> list[list[str]]:
    """Return for each row, given by the places of its frames, the rules that name one of them, in order."""
    places = [place for frames in rows for place in frames]
    found = named.between(min(places), max(places)) if named is not None and places else {}
    if not found:
        return [[]] * len(rows)
    return [sorted({rule for place in frames for rule in found.get(place, ())}) for frames in rows]


def tag(rules: Sequence[str]) -> str:
    """Write rules in front of what a row says."""
    return f"[{' '.join(rules)}] " if rules else ""
