"""A TOML table that is read key by key, so that every mistake is reported with file, line and what is allowed.

`dissectors.keys` says what a table may hold: a reader asks for a key by its name and its kind, and words and limits
come from there. A table that nothing is said of takes them from the reader.
"""

from __future__ import annotations

import re
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NoReturn

from dissectors.keys import Keys
from dissectors.keys.parsed import known
from dissectors.plain_files import read_bytes
from dissectors.records import dataclass, field, replace

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from dissectors.keys import Key
    from dissectors.keys.key import Kind

MAX_FILE_BYTES = 1024 * 1024

# Parts of a dotted key, of which the parser's work grows with the square; no table of ours has half as many.
_DEEPEST = 16
_PART = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')"""
_KEY = re.compile(r"""\s*(?:([A-Za-z0-9_-]+)|"([^"\\]*)"|'([^']*)')\s*""")
# Comments and texts; of several lines is the first group.
_SPANS = re.compile(
    r"""#[^\n]*|(\"{3}(?:[^"\\]|\\.|"(?!""))*"{3,5}|'{3}(?:[^']|'(?!''))*'{3,5})|"(?:[^"\\\n]|\\.)*"|'[^'\n]*'""",
    re.DOTALL,
)
_OPENED = re.compile(r"""=\s*(?:\"{3}|'{3})(.*)""")
_SYNTAX = re.compile(r"(.*) \(at line (\d+), column \d+\)")
_NUMBER = re.compile(r"[+-]?\d{1,20}(?:\.\d{1,20})?(?:[eE][+-]?\d{1,2}|/\d{1,20})?", re.ASCII)
_INTEGER = re.compile(r"[+-]?(?:\d{1,20}|0[xX][0-9a-fA-F]{1,16})", re.ASCII)


class ProfileError(ValueError):
    """A profile that cannot be used; the text reads `file:line: reason`, without a line (0) `file: reason`."""

    def __init__(self, file: str, line: int, reason: str) -> None:
        super().__init__(f"{file}:{line}: {reason}" if line else f"{file}: {reason}")
        self.file, self.line, self.reason = file, line, reason

    def __reduce__(self) -> tuple[type[ProfileError], tuple[str, int, str]]:
        """Pickle it with its three parts, not with its text."""
        return type(self), (self.file, self.line, self.reason)


class PlacedError(ProfileError):
    """One in a text of such a file, such as a filter; `place` are two lines: the text, and a caret under the place."""

    def __init__(self, file: str, line: int, reason: str, place: str) -> None:
        super().__init__(file, line, reason)
        self.place = place

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle it with its parts."""
        return type(self), (self.file, self.line, self.reason, self.place)

    def __str__(self) -> str:
        """Return the place behind the reason."""
        return f"{self.args[0]}\n{self.place}" if self.place else str(self.args[0])


@dataclass(frozen=True, slots=True)
class TomlTable:
    """One table of a file: `path` says where it stands, and keys that nobody asked for are an error (`finish`).

    `keys` are those that it may have; None if nothing is said of them. `row` is its place in a list of tables, from 0.
    """

    file: str
    text: str = field(repr=False)
    path: tuple[str, ...]
    body: dict[str, Any]
    keys: Keys | None = None
    asked: set[str] = field(default_factory=set)
    row: int | None = None

    def of(self, keys: Keys) -> TomlTable:
        """Return the same table as one that may have these keys."""
        return replace(self, keys=keys)

    def fail(self, reason: str, key: str = "") -> NoReturn:
        """Raise a `ProfileError` at the line of `key`, or of the table itself."""
        raise ProfileError(self.file, self._line_of(key), f"{self._words_of(key)}{reason}")

    def fail_inside(self, reason: str, key: str, before: str, place: str) -> NoReturn:
        """Raise a `PlacedError` at the line of the text of `key`, in which `before` stands before the `place`."""
        line = self._line_of(key)
        opened = _OPENED.search(self.text.splitlines()[line - 1])
        if opened is not None:
            line += before.count("\n") + (not opened[1])
        raise PlacedError(self.file, line, f"{self._words_of(key)}{reason}", place)

    def _line_of(self, key: str) -> int:
        return _line(self.text, (*self.path, key) if key else self.path, self.path, self.row or 0)

    def _words_of(self, key: str) -> str:
        name = ".".join(self.path)
        return "".join(
            ((f"[{name}] " if self.row is None else f"[[{name}]] ") if name else "", f"{key}: " if key else "")
        )

    def string(self, key: str, *, required: bool | None = None) -> str:
        """Return a text, empty if absent."""
        known = self._key(key, "text", "word", "enumeration")
        value: str | None = self.take(key, str, "a text")
        needed = known.required if required is None and known is not None else required
        if needed and not value:
            self.fail(f"{key} is missing")
        return value or ""

    def one_of(self, key: str, allowed: Iterable[str] | None = None, *, required: bool | None = None) -> str:
        """Return a text that is one of `allowed`, else of the key's words, or empty if absent."""
        known = self._key(key, "word", "enumeration")
        value = self.string(key, required=False)
        choices = list(known.words if allowed is None and known is not None else allowed or ())
        if value and value not in choices:
            self.fail(f"{value!r} is unknown (allowed: {', '.join(choices)})", key)
        return self.string(key, required=required)

    def flag(self, key: str) -> bool:
        """Return true or false, false if absent."""
        self._key(key, "flag")
        return bool(self.take(key, bool, "true or false"))

    def integer(self, key: str, low: int | None = None, high: int | None = None) -> int | None:
        """Return a whole number from `low` to `high`, else within the key's limits, None if absent."""
        least, most = self._limits(self._key(key, "whole", "bits"), low, high)
        value: int | None = self.take(key, int, "a whole number")
        if value is not None and not least <= value <= most:
            self.fail(f"{value} is outside {least} to {most}", key)
        return value

    def fraction(self, key: str) -> Fraction | None:
        """Return an exact number: 5, 0.1 or "1/100"; None if absent."""
        self._key(key, "number", "scale")
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
        """Return a `fraction` that is not zero."""
        self._key(key, "scale")
        value = self.fraction(key)
        if value == 0:
            self.fail("a scale cannot be zero", key)
        return value

    def strings(self, key: str) -> tuple[str, ...]:
        """Return a list of texts."""
        self._key(key, "texts", "words")
        return tuple(self._list(key, str, "texts"))

    def words(self, key: str) -> tuple[str, ...]:
        """Return a list of texts that are words of the key."""
        known, found = self._key(key, "words"), self.strings(key)
        allowed = known.words if known is not None else ()
        if not {*found} <= {*allowed}:
            self.fail(f"unknown word (allowed: {', '.join(allowed)})", key)
        return found

    def integers(self, key: str, low: int | None = None, high: int | None = None) -> tuple[int, ...]:
        """Return a list of whole numbers from `low` to `high`, else within the key's limits."""
        least, most = self._limits(self._key(key, "wholes"), low, high)
        values = tuple(self._list(key, int, "whole numbers"))
        if not all(least <= value <= most for value in values):
            self.fail(f"numbers from {least} to {most} are expected", key)
        return values

    def table(self, key: str) -> TomlTable:
        """Return a table inside this one, empty if absent."""
        known = self._key(key, "table", "tables", "bits")
        return self._inside(key, None if known is None else _inner(known))

    def tables(self, key: str) -> Iterator[tuple[str, TomlTable]]:
        """Yield the named tables inside the table `key`."""
        outer = self.table(key)
        for name in outer.body:
            yield name, outer.table(name)

    def rows(self, key: str) -> Iterator[TomlTable]:
        """Yield the tables of a list."""
        known = self._key(key, "rows")
        keys = None if known is None else known.keys
        for k, row in enumerate(self._list(key, dict, "tables")):
            yield TomlTable(self.file, self.text, (*self.path, key), row, keys, row=k)

    def texts(self, key: str) -> dict[int, str]:
        """Return a table from whole numbers to texts, as enumerations are written."""
        self._key(key, "codes", "enumeration")
        outer = self._inside(key, None)
        result: dict[int, str] = {}
        for name in outer.body:
            number = outer.number(name)
            if number in result:
                outer.fail(f"the value {number} has two texts", name)
            result[number] = outer.string(name)
        return result

    def number(self, key: str) -> int:
        """Return the whole number that a key itself is, as 12 or 0x0C."""
        if not _INTEGER.fullmatch(key):
            self.fail("a key that is a whole number is expected", key)
        return int(key, 16 if "x" in key.lower() else 10)

    def finish(self) -> None:
        """Refuse every key that was not asked for."""
        for key in self.body:
            if key not in self.asked:
                self.fail(f"unknown key (allowed: {', '.join(sorted(self.asked))})", key)

    def _key(self, key: str, *kinds: Kind) -> Key | None:
        """Return what is said of a key; a reader that asks for one that nothing is said of is wrong itself."""
        if self.keys is None:
            return None
        known = self.keys.find(key)
        if known is None or known.kind not in kinds:
            raise TypeError(f"dissectors.keys has no {' or '.join(kinds)} {key!r} in {self.keys.title}")
        return known

    @staticmethod
    def _limits(known: Key | None, low: int | None, high: int | None) -> tuple[int, int]:
        if known is None:
            return low or 0, high or 0
        return known.low if low is None else low, known.high if high is None else high

    def _inside(self, key: str, keys: Keys | None) -> TomlTable:
        return TomlTable(self.file, self.text, (*self.path, key), self.take(key, dict, "a table") or {}, keys)

    def take(self, key: str, kind: type, wanted: str) -> Any:
        """Return the value of a key, None if it is absent; a bool is not taken for an integer."""
        self.asked.add(key)
        value = self.body.get(key)
        if value is not None and (not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool)):
            self.fail(f"{wanted} is expected, not {value!r:.60}", key)
        return value

    def _list(self, key: str, kind: type, wanted: str) -> list[Any]:
        values = self.take(key, list, f"a list of {wanted}") or []
        if not all(isinstance(value, kind) and not (isinstance(value, bool) and kind is int) for value in values):
            self.fail(f"a list of {wanted} is expected", key)
        return list(values)


def _inner(known: Key) -> Keys | None:
    """Return the keys of a table: its own, or the same for any name."""
    return known.keys if known.each is None else Keys.any(known.each)


def read(path: Path, keys: Keys | None = None) -> TomlTable:
    """Return the top table of a TOML file of at most `MAX_FILE_BYTES`, which may have these keys."""
    file = str(path)
    try:
        data = read_bytes(path, MAX_FILE_BYTES + 1)
    except OSError as error:
        raise ProfileError(file, 0, error.strerror or "cannot be read") from None
    if len(data) > MAX_FILE_BYTES:
        raise ProfileError(file, 0, f"larger than {MAX_FILE_BYTES} bytes")
    return parse(data, file, keys)


def parse(data: bytes, file: str, keys: Keys | None = None) -> TomlTable:
    """Return the top table of a TOML text; `file` is its name in errors."""
    try:
        text = data.decode()
        said = known(data)
        return TomlTable(file, text, (), _parsed(text, file) if said is None else said, keys)
    except UnicodeDecodeError as error:
        raise ProfileError(file, data.count(b"\n", 0, error.start) + 1, "this is no UTF-8 text") from None
    except RecursionError:
        raise ProfileError(file, 1, "nested too deeply") from None
    except ValueError as error:
        found = _SYNTAX.fullmatch(str(error))
        line = int(found[2]) if found else text.count("\n") + 1
        raise ProfileError(file, line, found[1] if found else str(error)) from None


def _parsed(text: str, file: str) -> dict[str, Any]:
    import tomllib  # noqa: PLC0415 - for files of others only

    deep = rf"(?<![A-Za-z0-9_-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{_DEEPEST}}}"
    if found := re.search(deep, text):
        line = text.count("\n", 0, found.start()) + 1
        raise ProfileError(file, line, f"more than {_DEEPEST} parts of a dotted key")
    return tomllib.loads(text)


def _line(text: str, path: tuple[str, ...], table_path: tuple[str, ...], row: int) -> int:
    """Return the 1-based line where `path` is written; for a key inside an inline table, the line of that table.

    Of several tables at `table_path` it is looked for in that of number `row`.
    """
    best, best_line, seen = 0, 1, -1
    table: tuple[str, ...] = ()
    for number, line in enumerate(_SPANS.sub(_emptied, text).split("\n"), 1):
        start = line.lstrip()
        if start.startswith("["):
            here = table = _keys(start.lstrip("[ "))
            seen += start.startswith("[[") and table == table_path
        else:
            here = (*table, *_keys(start)) if _KEY.match(start) and "=" in start else ()
        if seen not in (-1, row) and here[: len(table_path)] == table_path:
            continue
        common = min(len(here), len(path))
        if here[:common] == path[:common] and common > best:
            best, best_line = common, number
    return best_line


def _emptied(found: re.Match[str]) -> str:
    """Return a text of several lines without what stands in it, anything else as it is."""
    return found[0] if found[1] is None else '""' + "\n" * found[0].count("\n")


def _keys(text: str) -> tuple[str, ...]:
    """Return the dotted key at the start of a line."""
    keys: list[str] = []
    position = 0
    while match := _KEY.match(text, position):
        keys.append(next(part for part in match.groups() if part is not None))
        position = match.end()
        if text[position : position + 1] != ".":
            break
        position += 1
    return tuple(keys)
