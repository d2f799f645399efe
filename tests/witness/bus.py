"""Proofs of rules about what several nodes send: BUS-038."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING

from witness.push_form import packets
from witness.views import SECOND, messages

if TYPE_CHECKING:
    from collections.abc import Iterator

    from witness.reader import Log
    from witness.views import Found

HELD = 2 * SECOND  # after the last throttle: no ESC holds it so long
TURNS = 500  # rpm
MOST = 20  # ESCs


def find_bus_038(log: Log) -> Found:
    """What an ESC says, from 2.0 s after its last throttle to the next one, while its motor turns and is driven."""
    commands = messages(log, "RawCommand")
    valid = [[one.t for one in commands if len(one["cmd"]) > k and one["cmd"][k] >= 0] for k in range(MOST)]
    found: dict[tuple[int, int], set[int]] = {}
    for t, index, rpm, throttle, numbers in _said(log):
        past = bisect_left(valid[index], t) if index < MOST else 0
        if past and t - valid[index][past - 1] >= HELD and abs(rpm) > TURNS and throttle:
            found.setdefault((index, past), set()).update(numbers)
    return list(found.values())


def _said(log: Log) -> Iterator[tuple[int, int, int, int, set[int]]]:
    """Time, index, speed, throttle and frames of each report of an ESC."""
    for one in messages(log, "ESCStatus"):
        yield one.t, one["esc_index"], one["rpm"], one["power_rating_pct"], one.numbers
    for piece, values in packets(log, "PUSHCAN.MotorStatus"):
        yield piece.t, piece.unit - 0xA1, values["speed"], values["throttle"], piece.numbers
