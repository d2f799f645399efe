"""Dataflash logs of an autopilot, written from ArduPilot's own description of its records."""

from __future__ import annotations

import random
import struct
from bisect import bisect_right
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

FMT = 128
_CODES = {
    "b": "b", "B": "B", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "d": "d", "n": "4s", "N": "16s", "Z": "64s",
    "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "M": "B", "q": "q", "Q": "Q",
}  # fmt: skip
_HUNDREDTHS = "cCeE"
_OUTPUTS = ",".join(f"C{k}" for k in range(1, 15))
TYPES = {
    "FMT": (FMT, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "PARM": (64, "QNff", "TimeUS,Name,Value,Default"),
    "MSG": (91, "QZ", "TimeUS,Message"),
    "ERR": (92, "QBB", "TimeUS,Subsys,ECode"),
    "EV": (93, "QB", "TimeUS,Id"),
    "MODE": (94, "QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    "ARM": (95, "QBIBB", "TimeUS,ArmState,ArmChecks,Forced,Method"),
    "RCOU": (96, "Q" + 14 * "H", "TimeUS," + _OUTPUTS),
    "BAT": (97, "QBfffffcfB", "TimeUS,Inst,Volt,VoltR,Curr,CurrTot,EnrgTot,Temp,Res,RemPct"),
    "ESC": (99, "QBeeffcfcf", "TimeUS,Instance,RPM,RawRPM,Volt,Curr,Temp,CTot,MotTemp,Err"),
    "IMU": (98, "QBfff", "TimeUS,I,GyrX,GyrY,GyrZ"),
}


def description(kind: int, name: str, form: str, columns: str) -> bytes:
    length = 3 + struct.calcsize("<" + "".join(_CODES[character] for character in form))
    values = [text.encode() for text in (name, form, columns)]
    return b"\xa3\x95" + struct.pack("<BBB4s16s64s", FMT, kind, length, *values)


HEAD = b"".join(description(kind, name, form, columns) for name, (kind, form, columns) in TYPES.items())


def record(name: str, *values: Any) -> bytes:
    """A record of one of `TYPES`, its time first."""
    kind, form, _ = TYPES[name]
    stored = [
        round(value * 100) if character in _HUNDREDTHS else value.encode() if isinstance(value, str) else value
        for character, value in zip(form, values, strict=True)
    ]
    return b"\xa3\x95" + struct.pack("<B" + "".join(_CODES[character] for character in form), kind, *stored)


def battery(micros: int, volt: float, current: float = 10.0, instance: int = 0) -> bytes:
    return record("BAT", micros, instance, volt, volt, current, 0, 0, 25, 0.01, 50)


def rcou(
    commands: Sequence[tuple[int, Sequence[int]]], boot: int, hz: float = 10, *, first: int = 1, noise: float = 0,
    drift: float = 0, seed: int = 1,
) -> list[tuple[int, bytes]]:  # fmt: skip
    """Outputs as an autopilot logs them that started at `boot`, ns: what it commanded last, in whole pulses of 1 us.

    ESC 1 is output `first`; `noise` is in us, `drift` is how much faster its clock is than that of the commands.
    """
    dice = random.Random(seed)
    times = [t for t, _ in commands]
    found, t = [], max(times[0], boot)
    while t <= times[-1]:
        t += round(1e9 / hz + dice.uniform(-2e5, 2e5))
        _, throttles = commands[max(bisect_right(times, t) - 1, 0)]
        pulses = [1000] * (first - 1) + [round(1000 + 1000 * one / 8191 + dice.gauss(0, noise)) for one in throttles]
        micros = round((t - boot) * (1 + drift)) // 1000
        found.append((micros, record("RCOU", micros, *(pulses + 14 * [0])[:14])))
    return found


def log(*parts: Iterable[tuple[int, bytes]], head: bytes = HEAD, beside: Callable[[int], bytes] | None = None) -> bytes:
    """A log of records with their times, in their order; `beside` gives others that stand between."""
    rows = sorted((row for part in parts for row in part), key=lambda row: row[0])
    return head + b"".join(row + (beside(t) if beside else b"") for t, row in rows)


def words(boot_to_start: int, *told: tuple[Any, ...]) -> list[tuple[int, bytes]]:
    """Records `(seconds after the start, name, values)`."""
    found = []
    for seconds, name, *values in told:
        micros = boot_to_start + round(seconds * 1e6)
        found.append((micros, record(name, micros, *values)))
    return found
