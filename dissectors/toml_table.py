"""A TOML table that is read key by key, so that every mistake is reported with file, line and what is allowed."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

MAX_FILE_BYTES = 1024 * 1024

_KEY = re.compile(r"""\s*(?:([A-Za-z0-9_-]+)|"([^"\\]*)"|'([^']*)')\s*""")
_SYNTAX = re.compile(r"(.*) \(at line (\d+), column \d+\)")
_NUMBER = re.compile(r"[+-]?\d{1,20}(?:\.\d{1,20})?(?:[eE][+-]?\d{1,2}|/\d{1,20})?", re.ASCII)
_INTEGER = re.compile(r"[+-]?(?:\d{1,20}|0[xX][0-9a-fA-F]{1,16})", re.ASCII)


class ProfileError(ValueError):
    """A profile that cannot be used; the text reads `file:line: reason`."""

    def __init__(self, file: str, line: int, reason: str) -> None:
        super().__init__(f"{file}:{line}: {reason}")
        self.file, self.line, self.reason = file, line, reason


@dataclass(frozen=True, slots=True)
class Table:
    """One table of a profile: `path` says where it stands, and keys that nobody asked for are an error (`finish`)."""

    file: str
    text: str = field(repr=False)
    path: tuple[str, ...]
    body: dict[str, Any]
    asked: set[str] = field(default_factory=set)

    def fail(self, reason: str, key: str = "") -> NoReturn:
        """Raises a `ProfileError` at the line of `key`, or of the table itself."""
        path = (*self.path, key) if key else self.path
        place = "".join(f"[{'.'.join(self.path)}] " if self.path else "")
        raise ProfileError(self.file, _line(self.text, path), f"{place}{f'{key}: ' if key else ''}{reason}")

    def take(self, key: str, kind: type, wanted: str) -> Any:
        """The value of a key, None if it is absent; a bool is not taken for an integer."""
        self.asked.add(key)
        value = self.body.get(key)
        if value is not None and (not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool)):
            self.fail(f"{wanted} is expected, not {value!r:.60}", key)
        return value

    def string(self, key: str, *, required: bool = False) -> str:
        """A text, empty if absent."""
        value: str | None = self.take(key, str, "a text")
        if required and not value:
            self.fail(f"{key} is missing")
        return value or ""

    def one_of(self, key: str, allowed: Iterable[str]) -> str:
        """A text that is one of `allowed`, or empty if absent."""
        value = self.string(key)
        choices = list(allowed)
        if value and value not in choices:
            self.fail(f"{value!r} is unknown (allowed: {', '.join(choices)})", key)
        return value

    def flag(self, key: str) -> bool:
        """True or false, false if absent."""
        return bool(self.take(key, bool, "true or false"))

    def integer(self, key: str, low: int, high: int) -> int | None:
        """A whole number from `low` to `high`, None if absent."""
        value: int | None = self.take(key, int, "a whole number")
        if value is not None and not low <= value <= high:
            self.fail(f"{value} is outside {low} to {high}", key)
        return value

    def fraction(self, key: str) -> Fraction | None:
        """An exact number: 5, 0.1 or "1/100"; None if absent."""
        value = self.take(key, object, "a number")
        if value is None:
            return None
        if isinstance(value, bool) or not _NUMBER.fullmatch(str(value)):
            self.fail(f"{value!r:.60} is no number (write 5, 0.1 or '1/100')", key)
        try:
            return Fraction(str(value))
        except ZeroDivisionError:
            self.fail("a division by zero", key)

    def scale(self, key: str) -> Fraction | None:
        """A `fraction` that is not zero."""
        value = self.fraction(key)
        if value == 0:
            self.fail("a scale cannot be zero", key)
        return value

    def strings(self, key: str) -> tuple[str, ...]:
        """A list of texts."""
        return tuple(self._list(key, str, "texts"))

    def integers(self, key: str, low: int, high: int) -> tuple[int, ...]:
        """A list of whole numbers from `low` to `high`."""
        values = tuple(self._list(key, int, "whole numbers"))
        if not all(low <= value <= high for value in values):
            self.fail(f"numbers from {low} to {high} are expected", key)
        return values

    def table(self, key: str) -> Table:
        """A table inside this one, empty if absent."""
        return Table(self.file, self.text, (*self.path, key), self.take(key, dict, "a table") or {})

    def tables(self, key: str) -> Iterator[tuple[str, Table]]:
        """The named tables inside the table `key`."""
        outer = self.table(key)
        for name in outer.body:
            yield name, outer.table(name)

    def rows(self, key: str) -> Iterator[Table]:
        """A list of inline tables."""
        for row in self._list(key, dict, "tables"):
            yield Table(self.file, self.text, (*self.path, key), row)

    def texts(self, key: str) -> dict[int, str]:
        """A table from whole numbers to texts, as enumerations are written."""
        outer = self.table(key)
        result: dict[int, str] = {}
        for name in outer.body:
            number = outer.number(name)
            if number in result:
                outer.fail(f"the value {number} has two texts", name)
            result[number] = outer.string(name)
        return result

    def number(self, key: str) -> int:
        """The whole number that a key itself is, as 12 or 0x0C."""
        if not _INTEGER.fullmatch(key):
            self.fail("a key that is a whole number is expected", key)
        return int(key, 16 if "x" in key.lower() else 10)

    def finish(self) -> None:
        """Every key that was not asked for is unknown."""
        for key in self.body:
            if key not in self.asked:
                self.fail(f"unknown key (allowed: {', '.join(sorted(self.asked))})", key)

    def _list(self, key: str, kind: type, wanted: str) -> list[Any]:
        values = self.take(key, list, f"a list of {wanted}") or []
        if not all(isinstance(value, kind) and not (isinstance(value, bool) and kind is int) for value in values):
            self.fail(f"a list of {wanted} is expected", key)
        return list(values)


def read(path: Path) -> Table:
    """The top table of a TOML file of at most `MAX_FILE_BYTES`."""
    file = str(path)
    try:
        with path.open("rb") as stream:
            data = stream.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        raise ProfileError(file, 1, error.strerror or "cannot be read") from None
    if len(data) > MAX_FILE_BYTES:
        raise ProfileError(file, 1, f"larger than {MAX_FILE_BYTES} bytes")
    return parse(data, file)


def parse(data: bytes, file: str) -> Table:
    """The top table of a TOML text; `file` is its name in errors."""
    try:
        text = data.decode()
        return Table(file, text, (), tomllib.loads(text))
    except UnicodeDecodeError as error:
        raise ProfileError(file, data.count(b"\n", 0, error.start) + 1, "this is no UTF-8 text") from None
    except RecursionError:
        raise ProfileError(file, 1, "nested too deeply") from None
    except ValueError as error:
        found = _SYNTAX.fullmatch(str(error))
        line = int(found[2]) if found else text.count("\n") + 1
        raise ProfileError(file, line, found[1] if found else str(error)) from None


def _line(text: str, path: tuple[str, ...]) -> int:
    """The 1-based line where `path` is written; for a key inside an inline table, the line of that table."""
    best, best_line = 0, 1
    table: tuple[str, ...] = ()
    for number, line in enumerate(text.splitlines(), 1):
        start = line.lstrip()
        if start.startswith("["):
            here = table = _keys(start.lstrip("["))
        else:
            here = (*table, *_keys(start)) if _KEY.match(start) and "=" in start else ()
        common = min(len(here), len(path))
        if here[:common] == path[:common] and common > best:
            best, best_line = common, number
    return best_line


def _keys(text: str) -> tuple[str, ...]:
    """The dotted key at the start of a line."""
    keys: list[str] = []
    position = 0
    while match := _KEY.match(text, position):
        keys.append(next(part for part in match.groups() if part is not None))
        position = match.end()
        if text[position : position + 1] != ".":
            break
        position += 1
    return tuple(keys)
