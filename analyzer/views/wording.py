"""Values and flaws in words: how numbers print, and what the statuses and anomalies of a transfer are called."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from analyzer.tables import TRANSFER_ANOMALIES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

MISSING = "-"
UNSPECIFIED = "unspecified"  # what a unit is called that nobody knows
_ANOMALIES = {
    "single toggle": "single frame with toggle 1",
    "toggle": "frame missing or out of order (toggle)",
    "duplicate frame": "frame repeated",
    "abandoned": "abandoned: its end never came",
    "timeout": "longer than 2.0 s",
    "slow": "longer than 1.0 s",
    "crc": "bad CRC",
    "frame not full": "frame before the last not full",
    "last frame empty": "last frame without data",
    "first frame too short": "first frame holds no more than the CRC",
    "needless multi": "several frames for what fits in one",
    "transfer id gap": "transfer ID skips",
    "duplicate": "same transfer again",
    "transfer id repeated": "transfer ID repeated",
    "transfer id restarted": "transfer ID restarted",
    "interleaved": "interleaved with another transfer of its type",
    "pause": "pause between its frames",
    "long": "unusually long",
    "priority changed": "priority changes inside",
    "destination zero": "destination 0",
    "source zero": "source 0",
    "addressed to itself": "addressed to itself",
    "can fd": "CAN FD",
    "cut by end": "capture ends inside",
    "other type": "CRC of another type with this ID",
    "limit": "a limit of the analyzer was reached",
}
_STEPPED = ("transfer id gap", "transfer id restarted")
# Said by the status of the transfer, or true of every transfer of a bus.
_SAID = ("abandoned", "timeout", "crc", "cut by end", "can fd")
LISTED = sum(1 << bit for bit, name in enumerate(TRANSFER_ANOMALIES) if name not in _SAID)


def anomalies(bits: int, step: int | None = None) -> list[str]:
    """Say the anomalies of a transfer in words; `step` is its transfer ID distance."""
    words = []
    for bit, name in enumerate(TRANSFER_ANOMALIES):
        if bits >> bit & 1:
            text = _ANOMALIES.get(name, name)
            words.append(f"{text} (+{step} instead of +1)" if name in _STEPPED and step is not None else text)
    return words


def plain(value: Any) -> str:
    """Write a value without a format: whole floats without point, others with up to 7 digits, lists with blanks."""
    if isinstance(value, float):
        return _float(value)
    if isinstance(value, list):
        return " ".join(plain(cell) for cell in value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} {plain(v)}" for k, v in value.items() if v is not None) + "}"
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    if value is None or value is True or value is False:
        return {None: MISSING, True: "yes", False: "no"}[value]
    return str(value)


def _float(value: float) -> str:
    if not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    # Not zero: its sign is worth seeing.
    return str(int(value)) if value and value.is_integer() and abs(value) < 1e15 else f"{value:.7g}"


def formatter(spec: str, texts: Mapping[float, str]) -> Callable[[Any], str]:
    """Return what prints cells of one column; values that have a name print it, and it never fails."""
    whole = spec[-1:] in ("b", "d", "o", "x", "X")

    def one(value: Any) -> str:
        if texts and value in texts:
            return texts[value]
        if not spec or value is None or isinstance(value, (str, bytes, dict, bool)):
            return plain(value)
        if isinstance(value, float) and (whole or not math.isfinite(value)):
            return format(int(value), spec) if math.isfinite(value) else plain(value)
        return format(value, spec)

    def cell(value: Any) -> str:
        return " ".join([one(inner) for inner in value]) if isinstance(value, list) else one(value)

    return cell
