"""The captures that patterns name, in folders or in any storage that fsspec knows, and whose they are."""

from __future__ import annotations

import csv
import re
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

_MAGIC = re.compile(r"[*?\[]")
_PASSWORD = re.compile(r"([a-z][a-z0-9+.-]*://[^/@:]*:)[^/@]*@")
_LOCAL = {"file", "local"}
_BARE = {"name", "size", "type", "url"}  # what a storage says of a file that says nothing of it
_ASKED = 16  # files that a web server is asked for at a time


class ListingError(Exception):
    """Captures that cannot be listed; says which and why."""


@dataclass(frozen=True, slots=True)
class ListedCapture:
    """A capture as its storage lists it: `etag` changes with its bytes, `size` is None if nobody says it."""

    url: str
    etag: str
    size: int | None


def listed(
    patterns: Sequence[str], without: str, empty: Callable[[str], None] = lambda _: None
) -> Iterator[ListedCapture]:
    """Yield what patterns, folders and addresses name, each once, in order; nothing below `without`, the store.

    `empty` is called with each pattern that names nothing else. Raises `ListingError`.
    """
    seen = set[str]()
    store = without.rstrip("/") + "/"
    for pattern in patterns:
        found = [one for one in _found(pattern) if not one.url.startswith(store)]
        if not found:
            empty(pattern)
        for one in found:
            if one.url not in seen:
                seen.add(one.url)
                yield one


def _found(pattern: str) -> list[ListedCapture]:
    from fsspec.core import url_to_fs  # noqa: PLC0415 - of the extra

    without_password(pattern)
    try:
        files, path = url_to_fs(pattern)
        local = bool(_LOCAL & {files.protocol} if isinstance(files.protocol, str) else _LOCAL & set(files.protocol))
        if _MAGIC.search(path) and not (local and Path(path).exists()):  # a name may have brackets in it
            found = files.glob(path, detail=True)
        elif files.isdir(path):
            found = files.find(path, detail=True)
        else:
            found = {path: files.info(path)}
        if local:
            found = {name: _followed(files, name, info) for name, info in found.items()}
        found = _told(files, {name: info for name, info in found.items() if info.get("type") == "file"})
    except FileNotFoundError:
        raise ListingError(f"{pattern}: no such file") from None
    except ImportError as error:
        raise ListingError(f"{pattern}: {error}") from None
    except Exception as error:  # whatever a storage raises
        raise ListingError(f"{pattern}: {type(error).__name__}: {error}") from error
    # A path of SSH does not tell the machine: what stands before it in the pattern does.
    root = pattern.removesuffix(path) if pattern.endswith(path) and not local else ""
    names = {name: name if local else f"{root}{name}" if root else files.unstrip_protocol(name) for name in found}
    return sorted(
        (ListedCapture(names[name], _etag(info), info.get("size")) for name, info in found.items()), key=_by_url
    )


def _followed(files: Any, name: str, info: dict[str, Any]) -> dict[str, Any]:
    """Return what a link leads to, if that is a file: what is not there, or leads in circles, is no capture."""
    followed: dict[str, Any] = files.info(name) if info.get("islink") and Path(name).is_file() else info
    return followed


def _by_url(one: ListedCapture) -> str:
    return one.url


def _told(files: Any, found: dict[str, Any]) -> dict[str, Any]:
    """Return files with what tells their version: a web server lists names alone, and is asked for each."""
    bare = [name for name, info in found.items() if info.get("size") is None and set(info) <= _BARE]
    if not bare:
        return found
    from concurrent.futures import ThreadPoolExecutor  # noqa: PLC0415

    with ThreadPoolExecutor(_ASKED) as pool:
        return {**found, **dict(zip(bare, pool.map(files.info, bare), strict=True))}


def without_password(address: str) -> None:
    """Raise `ValueError` for an address with a password in it: it would stand in the results for all to see."""
    if found := _PASSWORD.match(address):
        raise ValueError(f"{found[1]}...: no password in an address: keys come from the environment or an agent")


def _etag(info: Mapping[str, Any]) -> str:
    for name in ("ETag", "etag", "md5Hash", "content_md5"):
        if info.get(name):
            return str(info[name]).strip('"')
    changed = info.get("mtime") or info.get("LastModified") or info.get("last_modified") or ""
    return f"{info.get('size')}-{changed}"


class Provenance:
    """Whose a capture is and of which day: by a pattern over its address, or by a CSV file with the column `url`.

    Raises `ValueError` for a pattern without fields, or a wrong CSV file, and `OSError`.
    """

    def __init__(self, pattern: str | None = None, table: str | None = None) -> None:
        self._pattern = None if pattern is None else _compiled(pattern)
        self._rows = {} if table is None else _read(table)

    def of(self, url: str) -> tuple[str, str]:
        """Return vehicle and date, empty where nobody tells them."""
        known = self._rows.get(url) or self._rows.get(url.rpartition("/")[2])
        if known is not None:
            return known
        found = None if self._pattern is None else self._pattern.search(url)
        told = {} if found is None else found.groupdict()
        return told.get("vehicle", ""), _day(told.get("date", ""))


def _compiled(pattern: str) -> re.Pattern[str]:
    parts = re.split(r"(\{\w*\}|\*\*/?|\*|\?)", pattern)
    fields = [one[1:-1] for one in parts if one.startswith("{")]
    if not fields or set(fields) - {"vehicle", "date"} or len(fields) != len(set(fields)):
        raise ValueError(f"--name {pattern}: it takes {{vehicle}} and {{date}}, each once")
    wild = {"*": "[^/]*", "?": "[^/]", "**": ".*", "**/": "(?:.*/)?"}
    made = (
        f"(?P<{one[1:-1]}>[^/]+?)" if one.startswith("{") else wild[one] if one in wild else re.escape(one)
        for one in parts
    )  # fmt: skip
    return re.compile(f"(?:^|/){''.join(made)}$")


def _read(path: str) -> dict[str, tuple[str, str]]:
    try:
        return _named(path)
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: no CSV in UTF-8: {error}") from None


def _named(path: str) -> dict[str, tuple[str, str]]:
    with Path(path).open(newline="", encoding="utf-8-sig") as file:
        rows = csv.DictReader(file)
        if "url" not in (rows.fieldnames or ()):
            raise ValueError(f"{path}: line 1: no column url")
        found = {}
        for row in rows:
            day = row.get("date") or ""
            if day and not _day(day):
                raise ValueError(f"{path}: line {rows.line_num}: {day!r} is no day, such as 2026-11-22")
            found[row["url"]] = row.get("vehicle") or "", _day(day)
        return found


def _day(text: str) -> str:
    try:
        return date.fromisoformat(text).isoformat()
    except ValueError:
        return ""
