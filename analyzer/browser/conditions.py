"""Filters made by gestures: what a line of the details says, as somebody would write it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from analyzer.filter.compiled import compile_expression, compile_filter
from analyzer.filter.language.errors import FilterError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.browser.details import DetailLine
    from analyzer.decode.engine import Batch
    from dissectors import Registry

COMBINED = {
    "": "{new}", "and": "({old}) && {new}", "or": "({old}) || {new}", "not": "!({new})",
    "and not": "({old}) && !({new})", "or not": "({old}) || !({new})",
}  # fmt: skip
_WORD, _QUOTED = re.compile(r"^[a-z ]+$"), re.compile(r'"(.*)"$')
_OF_ALL = ("frame.", "can.", "finding.")  # what is asked of them is not known of a row alone
_BYTES = re.compile(r"^[0-9A-F]{2}(:[0-9A-F]{2})+$")
_NUMBER = re.compile(r"^(0x[0-9A-F]+|-?\d+(?:\.\d+)?)")


def combined(old: str, new: str, how: str) -> str:
    """Return a filter with what was there before; `how` is a key of `COMBINED`."""
    if not old and how in ("and", "or"):
        how = ""
    if not old and how in ("and not", "or not"):
        how = "not"
    return COMBINED[how].format(old=old, new=new)


def field_name(name: str, registry: Registry) -> str:
    """Return the name of a field as a filter takes it, the shortest that works; empty for none."""
    for one in _names(name):
        try:
            compile_filter(f"exists({one})", registry)
        except FilterError:
            continue
        return one
    return ""


def condition(line: DetailLine, registry: Registry, batch: Batch | None) -> str:
    """Return a filter that selects rows which say the same as a line of the details; empty for none.

    Of candidates that make sense it is the first that selects the row itself, the only one of `batch`.
    """
    name = field_name(line.name, registry)
    if not name:
        return ""
    for text in _candidates(name, line, registry, batch):
        try:
            chosen = compile_filter(text, registry)
            if batch is None or not len(batch.transfers) or name.startswith(_OF_ALL):
                return text
            if chosen.matcher().feed(batch).transfers.any():
                return text
        except FilterError:
            continue
    return f"exists({name})"


def _names(name: str) -> Iterator[str]:
    """Yield ways to write a name, the shortest first."""
    if not name:
        return
    words = name.split(".")
    for start in range(len(words) - 1, -1, -1):
        if words[start][:1].isupper() and (start == 0 or not words[start - 1][:1].isupper()):
            yield ".".join(words[start:])
    yield name
    # Behind the type of a service stands which half it is.
    at = next((k for k, word in enumerate(words) if word[:1].isupper()), None)
    if at is not None:
        for half in ("Response", "Request"):
            yield ".".join((*words[: at + 1], half, *words[at + 1 :]))


def _candidates(name: str, line: DetailLine, registry: Registry, batch: Batch | None) -> Iterator[str]:
    value = line.value.strip()
    if not value:
        yield name
    if value.startswith("set") or value == "yes":
        yield name
    if value.startswith("not set") or value == "no":
        yield f"exists({name}) && !{name}"
    quoted = _QUOTED.search(value)
    if quoted:
        yield f'{name} == "{quoted[1]}"'
    if value and batch is not None and len(batch.transfers) and not name.startswith(_OF_ALL):
        yield from _exact(name, registry, batch)
    if _BYTES.match(value):
        yield f"{name} == {value}"
    elif number := _NUMBER.match(value):
        yield f"{name} == {number[1]}"
    if _WORD.match(value):
        yield f'{name} == "{value}"'
    yield f"exists({name})"


def _exact(name: str, registry: Registry, batch: Batch) -> Iterator[str]:
    """Yield a comparison with the number itself, with all its digits."""
    try:
        values = compile_expression(name, registry).feed(batch)
    except (FilterError, KeyError):
        return
    if len(values.every):
        number = values.every[0].item()
        whole = isinstance(number, bool) or float(number).is_integer()
        yield f"{name} == {int(number) if whole else number!r}"
