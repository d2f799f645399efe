"""Numbers, times and spans as short texts that keep their width while they change."""

from __future__ import annotations

from datetime import datetime

from dissectors.kit import MILLISECOND, SECOND

_UNITS = ((1e9, "G"), (1e6, "M"), (1e3, "k"))
_MINUTE, _HOUR, _DAY = 60, 3600, 86400


def number(value: float | None, *, whole: bool = False) -> str:
    """Write a measured value; one decimal below a thousand unless it is whole."""
    if value is None:
        return "-"
    if abs(value) >= 1e6:
        return amount(value)
    return f"{value:.0f}" if whole or abs(value) >= 1000 else f"{value:.1f}"


def amount(value: float) -> str:
    """Write a count in at most five columns: 12345, 1.23M."""
    for unit, letter in _UNITS:
        if abs(value) >= unit and abs(value) >= 100_000:
            short = value / unit
            return f"{short:.0f}{letter}" if short >= 100 else f"{short:.1f}{letter}"
    return f"{value:.0f}"


def rate(value: float) -> str:
    """Write times a second; those below ten have a decimal."""
    return amount(value) if value >= 10 or not value else f"{value:.1f}"


def size(count: int) -> str:
    """Write a size in bytes: 12.3MB."""
    for unit, letter in _UNITS:
        if count >= unit:
            return f"{count / unit:.1f}{letter}B"
    return f"{count}B"


def bits(value: int) -> str:
    """Write a bit rate: 500k, 1M."""
    for unit, letter in _UNITS:
        if value >= unit:
            return f"{value / unit:g}{letter}"
    return str(value)


def span(ns: int | None) -> str:
    """Write a time span: 30ms, 1.2s, 45s, 12m, 3h, 2d."""
    if ns is None:
        return "-"
    if ns < SECOND:
        return f"{ns // MILLISECOND}ms"
    seconds = ns / SECOND
    if seconds < 10:
        return f"{seconds:.1f}s"
    for unit, letter in ((_DAY, "d"), (_HOUR, "h"), (_MINUTE, "m")):
        if seconds >= 2 * unit:
            return f"{seconds / unit:.0f}{letter}"
    return f"{seconds:.0f}s"


def age(ns: int | None) -> str:
    """Write how long ago: <0.1s, 0.4s, then as `span`; what is fresh does not flicker."""
    if ns is None or ns >= SECOND:
        return span(ns)
    return f"{ns // (100 * MILLISECOND) / 10:.1f}s" if ns >= 100 * MILLISECOND else "<0.1s"


def duration(seconds: int | None) -> str:
    """Write how long something runs: 0:12, 1:02:03, 2d 03:04."""
    if seconds is None:
        return "-"
    days, rest = divmod(seconds, _DAY)
    hours, rest = divmod(rest, _HOUR)
    minutes, rest = divmod(rest, _MINUTE)
    if days:
        return f"{days}d {hours:02}:{minutes:02}"
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def clock(ns: int) -> str:
    """Write the time of day here; none before 1970."""
    return "--:--:--" if ns < 0 else datetime.fromtimestamp(ns // SECOND).astimezone().strftime("%H:%M:%S")
