"""Captures and errors go through pickle, as they do between the processes of a pool."""

from __future__ import annotations

import errno
import io
import os
import pickle
from typing import TYPE_CHECKING

import pytest
from kit.command import HOVER

import analyzer
from analyzer.live.interfaces.naming import InterfaceError
from analyzer.sinks.atomic import TargetError
from analyzer.sinks.growing import GoneError
from analyzer.sources.errors import UnpackError
from dissectors import DsdlError, ProfileError
from dissectors.registry import UnknownNameError

if TYPE_CHECKING:
    from pathlib import Path

ERRORS = [
    analyzer.CaptureError("a.log", "byte 7", "ends early"),
    analyzer.UnavailableError("a.log", "", "No such file or directory"),
    UnpackError(12, "damaged"),
    DsdlError("a.dsdl", 3, "no type"),
    ProfileError("a.toml", 0, "no key"),
    TargetError("out.parquet", OSError(errno.ENOSPC, "No space left on device")),
    GoneError("out.log", "moved away"),
    InterfaceError("can7", "no such device"),
    UnknownNameError("ESC", ("ESCStatus",), several=False),
]


def again(thing: object) -> object:
    return pickle.loads(pickle.dumps(thing))


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_keeps_its_parts(error: Exception) -> None:
    copy = again(error)
    assert type(copy) is type(error)
    assert (str(copy), vars(copy)) == (str(error), vars(error))


def test_the_parts_of_an_error_are_those_of_its_text(tmp_path: Path) -> None:
    path = tmp_path / "cut.log"
    path.write_bytes(HOVER.read_bytes()[:-5])
    capture = analyzer.open_capture(path)
    list(capture)
    damage = capture.damage
    assert type(damage) is analyzer.CaptureError
    assert str(damage) == f"{damage.name}: {damage.place}: {damage.reason}"
    assert (damage.name, damage.reason) == (str(path), "the capture ends in the middle of a line")


class Broken(io.RawIOBase):
    """A file on a network that is gone."""

    name = "far.log"

    def readable(self) -> bool:
        return True

    def read(self, _: int = -1, /) -> bytes:
        raise OSError(errno.EIO, os.strerror(errno.EIO))


def test_what_could_not_be_read_now_is_not_damaged(tmp_path: Path) -> None:
    with pytest.raises(analyzer.UnavailableError, match="No such file"):
        list(analyzer.open_capture(tmp_path / "missing.log"))
    capture = analyzer.open_capture(Broken())
    list(capture)
    assert type(capture.damage) is analyzer.UnavailableError
    packed = tmp_path / "log.xz"
    packed.write_bytes(b"\xfd7zXZ\0 and more")
    for refused in (packed, tmp_path):
        with pytest.raises(analyzer.CaptureError) as raised:
            list(analyzer.open_capture(refused))
        assert type(raised.value) is analyzer.CaptureError


def test_a_capture_before_it_is_opened_and_after_it_was_read() -> None:
    capture = analyzer.open_capture([HOVER, str(HOVER)], offsets={str(HOVER): 5}, same_bus=True)
    fresh = again(analyzer.open_capture(HOVER))
    assert isinstance(fresh, analyzer.Capture)
    whole = analyzer.open_capture(HOVER)
    assert fresh.table("ESCStatus") == whole.table("ESCStatus")
    assert again(whole).table("transfers") == whole.table("transfers")  # type: ignore[attr-defined]
    assert pickle.dumps(again(capture)) == pickle.dumps(capture)


def test_a_capture_of_a_file_object_does_not() -> None:
    with HOVER.open("rb") as file, pytest.raises(TypeError, match="pickle"):
        pickle.dumps(analyzer.open_capture(file))
