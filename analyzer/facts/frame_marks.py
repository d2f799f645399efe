"""Marks and comments on frames of a capture, kept beside it in `<capture>.marks.toml`."""

from __future__ import annotations

import json
from contextlib import suppress
from errno import ENAMETOOLONG, ENOENT, ENOTDIR
from pathlib import Path
from typing import TYPE_CHECKING

from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

SUFFIX = ".marks.toml"
_NO_FILE = (ENOENT, ENOTDIR, ENAMETOOLONG)  # a capture's name may be too long for a suffix
MARKED = "marked"
_MOST_TEXT = 4096  # characters of a comment
_MOST = 100_000


class MarksError(ValueError):
    """A file of marks is wrong; says where and why in one line."""


@dataclass(frozen=True, slots=True)
class Mark:
    """A mark on a frame, by its place from 0; `text` is the comment, empty for none; `t` is its time if it has one."""

    frame: int
    text: str = ""
    t: int | None = None

    @property
    def words(self) -> str:
        """The comment, or a word for a mark without one."""
        return self.text or MARKED


class MarkBook:
    """The marks of a capture, by frame.

    Args:
        path: of the file; None keeps nothing.
    """

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self.marks: dict[int, Mark] = {}
        self.changed = False

    def toggle(self, frame: int, t: int | None) -> bool:
        """Mark a frame, or take a mark without a comment off; return whether it is marked now."""
        self.changed = True
        old = self.marks.get(frame)
        if old is not None and not old.text:
            del self.marks[frame]
            return False
        if old is None:
            self.marks[frame] = Mark(frame, "", t)
        return True

    def comment(self, frame: int, text: str, t: int | None) -> None:
        """Write a comment on a frame; an empty one takes the mark off."""
        self.changed = True
        if text:
            self.marks[frame] = Mark(frame, text[:_MOST_TEXT], t)
        else:
            self.marks.pop(frame, None)

    def ordered(self) -> list[Mark]:
        """Return the marks by frame."""
        return [self.marks[frame] for frame in sorted(self.marks)]

    def save(self) -> None:
        """Write the file, or remove it if nothing is marked any more. Raises `OSError`."""
        if self.path is None:
            return
        if not self.marks:
            self.path.unlink(missing_ok=True)
        else:
            part = self.path.with_name(self.path.name + ".part")
            try:
                part.write_text("".join(_written(self.ordered())), encoding="utf-8")
                part.replace(self.path)
            except OSError:
                with suppress(OSError):
                    part.unlink()
                raise
        self.changed = False


def marks_path(capture: str) -> Path:
    """Return the path of the marks of a capture."""
    return Path(capture + SUFFIX)


def read_marks(path: Path) -> dict[int, Mark]:
    """Return the marks of a file by frame, none if there is no file. Raises `MarksError`."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        if isinstance(error, OSError) and error.errno in _NO_FILE:
            return {}
        raise MarksError(f"{path}: {error.strerror if isinstance(error, OSError) else error}") from None
    import tomllib  # noqa: PLC0415 - most captures have no marks

    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise MarksError(f"{path}: {error}") from None
    rows = content.get("mark", [])
    if not isinstance(rows, list) or set(content) - {"mark"}:
        raise MarksError(f"{path}: marks are tables [[mark]] with frame and text")
    return {mark.frame: mark for mark in (_mark(path, k, row) for k, row in enumerate(rows[:_MOST], 1))}


def marks_beside(captures: Sequence[str]) -> list[Mark]:
    """Return the marks beside a capture by frame; none of several captures. Raises `MarksError`."""
    if len(captures) != 1 or captures[0] == "-":
        return []
    found = read_marks(marks_path(captures[0]))
    return [found[frame] for frame in sorted(found)]


def comments_beside(captures: Sequence[str]) -> dict[int, str]:
    """Return what stands beside a capture about frames, from 0, a mark without words too. Raises `MarksError`."""
    return {mark.frame: mark.words for mark in marks_beside(captures)}


def _mark(path: Path, number: int, row: object) -> Mark:
    if not isinstance(row, dict):
        raise MarksError(f"{path}: mark {number} is no table")
    frame, text, t = row.get("frame"), row.get("text", ""), row.get("t_ns")
    if not isinstance(frame, int) or isinstance(frame, bool) or frame < 1:
        raise MarksError(f"{path}: mark {number}: frame is a number from 1")
    if not isinstance(text, str) or not (t is None or isinstance(t, int)):
        raise MarksError(f"{path}: mark {number}: text is a string, t_ns nanoseconds since 1970")
    return Mark(frame - 1, text[:_MOST_TEXT], t)


def _written(marks: list[Mark]) -> Iterator[str]:
    yield "# Marks of tailbyte view: frames count from 1.\n"
    for one in marks:
        time = "" if one.t is None else f"t_ns = {one.t}\n"
        yield f"\n[[mark]]\nframe = {one.frame + 1}\n{time}text = {json.dumps(one.text, ensure_ascii=False)}\n"
