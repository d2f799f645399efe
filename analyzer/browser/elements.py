"""Elements of arrays as details of their own: each with its bits, and with the name that filters have for it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from analyzer.browser.details import DetailLine

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_NUMBER, _HEX = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"), re.compile(r"[0-9A-F]{2}")
_LEAST, _MOST = 2, 64  # elements
_BYTE = 8  # bits: what is as narrow is written as bytes, which need no lines


def with_elements(lines: Sequence[DetailLine]) -> list[DetailLine]:
    """Return details with a line for each element behind those of arrays of numbers."""
    found: list[DetailLine] = []
    for line in lines:
        found.append(line)
        found += _elements(line)
    return found


def _elements(line: DetailLine) -> Iterator[DetailLine]:
    if line.bits is None or line.inside or not line.name:
        return
    words = line.value.split(" ")
    unit = "" if _NUMBER.fullmatch(words[-1]) else f" {words.pop()}"
    first, last = line.bits
    size, more = divmod(last + 1 - first, max(1, len(words)))
    if more or not _LEAST <= len(words) <= _MOST or not all(map(_NUMBER.fullmatch, words)):
        return
    if size == _BYTE and all(map(_HEX.fullmatch, words)):
        return
    begin, end = ("[", "]") if line.text.startswith("[") else ("", "")
    for k, word in enumerate(words):
        bits, value = (first + k * size, first + (k + 1) * size - 1), f"{word}{unit}"
        label = f"{begin}{line.name.rpartition('.')[2]}[{k}]: {value}{end}"
        yield DetailLine(line.depth + 1, label, bits, name=f"{line.name}[{k}]", value=value)
