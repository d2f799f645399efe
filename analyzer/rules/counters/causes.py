"""Causes of steps of a node, as they are told: a counter for all types, several senders, one that wraps early."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.rules.counters.id_steps import RESTARTED
from analyzer.tables import TRANSFER_IDS
from dissectors.kit import Occurrence

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer._native import _IdCause
    from dissectors.kit import Values, View

SHARED_COUNTER, SHARED_ID = "TRF-020", "BUS-010"
WRAPPING = "the counter always wraps after {}"
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight")
_TYPES, _BY_TURNS, _GOES_ON, _WRAPS = range(4)  # kinds of causes, as the core numbers them


def shown_causes(view: View, causes: Iterable[_IdCause]) -> Iterator[Occurrence]:
    """Yield causes each time that they show."""
    for bus, node, t, frames, kind, numbers in causes:
        rule, values = _words(view, node, kind, numbers)
        yield Occurrence(rule, t, bus, node, "", tuple(frames), values)


def _words(view: View, node: int, kind: int, numbers: Sequence[int]) -> tuple[str, Values]:
    """Return the rule of a cause, and its values."""
    if kind == _TYPES:
        return SHARED_COUNTER, {"types": numbers[0], "node": node}
    if kind == _WRAPS:
        transfer_id, before = numbers
        expected = (before + 1) % TRANSFER_IDS
        return RESTARTED, {"transfer_id": transfer_id, "expected": expected, "cause": WRAPPING.format(before)}
    code, *ids = numbers
    name = view.type_name(code)
    if kind == _BY_TURNS:
        *places, last = map(str, ids)
        evidence = f"{_NUMBERS[len(ids)]} transfer-ID counters in {name}, at {', '.join(places)} and {last}"
    else:
        at, other = ids
        between = "no order" if other < 0 else f"always {other}"
        evidence = f"a transfer-ID counter in {name} at {at}, and in between {between}"
    return SHARED_ID, {"evidence": evidence}
