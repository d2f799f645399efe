"""ESCs that fly for minutes, report by report, each as healthy or as odd as a test wants it."""

from __future__ import annotations

import math
import random
from typing import TYPE_CHECKING, Any

from kit.encode import log_line, transfer

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

SECOND, MS = 10**9, 10**6
START = 1_773_475_330 * SECOND
# What one ESC is at a time (s): shares of speed, current, degrees and volts beside it, and whether a report is lost.
Odd = dict[str, float]


def healthy(_: int, __: float) -> Odd:
    return {}


def flight(
    escs: int = 4, seconds: float = 60, hz: float = 10, odd: Callable[[int, float], Odd] = healthy, *, seed: int = 1,
    without: Sequence[str] = (), rests: Sequence[tuple[float, float]] = (), commands: float = 25,
) -> bytes:  # fmt: skip
    """Candump text of a hover in gusts. Motors stand in `rests` (s), which are between flights.

    Fields in `without` have what an ESC sends that does not measure them: NaN, or 0 for whole numbers.
    """
    dice = random.Random(seed)
    rows: list[tuple[float, int, str, dict[str, Any]]] = []
    gusts = [dice.uniform(0, 6) for _ in range(escs)]
    unlike = [dice.uniform(-0.01, 0.01) for _ in range(escs)]

    def throttle(esc: int, t: float) -> float:
        if t < 1 or any(start <= t < stop for start, stop in rests):
            return 0.0
        return 48 + t / 60 + 1.2 * math.sin(t / 0.9 + gusts[esc]) + 0.8 * math.sin(t / 3.1 + 2 * gusts[esc])

    for k in range(int(seconds * commands)):
        t = k / commands
        cmd = [round(81.91 * throttle(esc, t)) for esc in range(escs)]
        rows.append((t, 1, "RawCommand", {"cmd": cmd}))
    for esc in range(escs):
        for k in range(int(seconds * hz)):
            t = (k + (esc + 0.5) / escs) / hz
            rows.append((t, 11 + esc, "ESCStatus", _status(esc, t, throttle(esc, t), odd(esc, t), unlike[esc], dice)))
    return _text(rows, without)


def _status(esc: int, t: float, throttle: float, odd: Odd, unlike: float, dice: random.Random) -> dict[str, Any]:
    volts = (49.5 - t / 100) * (1 + odd.get("volts", 0)) - throttle / 50
    rpm = 1.05 * volts * throttle * (1 + odd.get("speed", 0)) * dice.gauss(1, 0.004)
    power = 34 * (rpm / 1000) ** 3 * (1 + odd.get("current", 0) + 2 * unlike) * dice.gauss(1, 0.04)
    warm = 20 + 40 * (1 - math.exp(-t / 150)) * (1 + odd.get("current", 0) + 5 * unlike) + odd.get("degrees", 0)
    return {
        "error_count": (4 if throttle else 2) << 12, "voltage": volts, "current": power / volts + 0.06,
        "temperature": warm + dice.gauss(0, 0.2), "rpm": round(rpm), "power_rating_pct": round(throttle),
        "esc_index": esc, "lost": odd.get("lost", 0) > dice.random(),
    }  # fmt: skip


def _text(rows: list[tuple[float, int, str, dict[str, Any]]], without: Sequence[str]) -> bytes:
    numbers: dict[tuple[int, str], int] = {}
    lines = []
    for t, node, name, fields in sorted(rows, key=lambda row: row[:2]):
        number = numbers[node, name] = (numbers.get((node, name), -1) + 1) % 32
        if not fields.pop("lost", False):
            fields |= {one: 0 if one in {"rpm", "power_rating_pct"} else math.nan for one in without if one in fields}
            frames = transfer(name, fields, node, number).frames(START + round(t * SECOND))
            lines += [log_line(frame) + "\n" for frame in frames]
    return "".join(lines).encode()
