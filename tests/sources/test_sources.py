"""Where bytes come from: gzip in every state, what is refused, what a source says of itself afterwards."""

from __future__ import annotations

import gzip
import hashlib
import random
from typing import TYPE_CHECKING

import pytest
import zstandard
from kit.command import HOVER

from analyzer.sources import CaptureError, Source
from analyzer.sources.errors import UnpackError
from analyzer.sources.formats import detect
from analyzer.sources.inflate import inflate
from analyzer.sources.stored import CHUNK

if TYPE_CHECKING:
    from pathlib import Path

TEXT = HOVER.read_bytes()
PACKED = gzip.compress(TEXT, mtime=0)


def pieces(data: bytes, size: int) -> list[bytes]:
    return [data[at : at + size] for at in range(0, len(data), size)]


def unpack(data: bytes, size: int = 1 << 20) -> tuple[bytes, UnpackError | None]:
    """Everything that came out, and the error behind it."""
    out = b""
    try:
        for piece in inflate(pieces(data, size)):
            out += piece
    except UnpackError as error:
        return out, error
    return out, None


def read(path: Path, data: bytes) -> tuple[bytes, Source]:
    path.write_bytes(data)
    source = Source(str(path), hashed=True)
    return b"".join(source.chunks()), source


@pytest.mark.parametrize("size", [1, 7, 4096, 1 << 20])
def test_whole_gzip(size: int) -> None:
    assert unpack(PACKED, size) == (TEXT, None)
    members = gzip.compress(TEXT[:100]) + gzip.compress(b"") + gzip.compress(TEXT[100:])
    assert unpack(members, size) == (TEXT, None)
    assert unpack(members + bytes(5000), size) == (TEXT, None)


@pytest.mark.parametrize("cut", [3, 9, 10, 11, 500, *(len(PACKED) - k for k in (9000, 9, 8, 1))])
def test_gzip_that_ends_early(cut: int) -> None:
    out, error = unpack(PACKED[:cut])
    assert error is not None
    assert (error.place, error.reason) == (cut, "gzip data ends early")
    assert TEXT.startswith(out)
    assert len(out) >= len(TEXT) * (cut - 3000) / len(PACKED)
    if cut >= len(PACKED) - 8:
        assert out == TEXT


@pytest.mark.parametrize("size", [1000, 1 << 20])
def test_what_stands_before_damage_is_delivered(size: int) -> None:
    """Damage that deflate itself notices: a block of the type that does not exist, behind a sound member."""
    bad = gzip.compress(b"")[:10] + b"\x07"
    out, error = unpack(PACKED + bad, size)
    assert out == TEXT
    assert error is not None
    assert (error.place, error.reason) == (len(PACKED) + 10, "damaged gzip data (invalid block type)")


def test_a_wrong_checksum_or_length_is_found_at_its_place() -> None:
    for offset, reason in ((8, "incorrect data check"), (4, "incorrect length check")):
        damaged = bytearray(PACKED)
        damaged[-offset] ^= 1
        out, error = unpack(bytes(damaged))
        assert out == TEXT
        assert error is not None
        assert error.reason == f"damaged gzip data ({reason})"
        assert len(PACKED) - offset <= error.place < len(PACKED)


def test_data_behind_the_end() -> None:
    out, error = unpack(PACKED + b"garbage")
    assert out == TEXT
    assert error is not None
    assert (error.place, error.reason) == (len(PACKED), "data behind the end of the gzip data")


@pytest.mark.parametrize("seed", range(40))
def test_no_damage_hides_anything_before_it(seed: int) -> None:
    """One changed byte anywhere: text is as it was up to the first block that it can have changed, and it is told."""
    chance = random.Random(seed)
    members = [gzip.compress(part, mtime=0) for part in pieces(TEXT, 9000)]
    hit = chance.randrange(len(members))
    packed = [bytearray(member) for member in members]
    at = chance.randrange(10, len(packed[hit]))
    packed[hit][at] ^= 1 << chance.randrange(8)
    out, error = unpack(b"".join(packed), chance.choice([100, 5000, 1 << 20]))
    assert error is not None
    assert out.startswith(TEXT[: 9000 * hit])
    assert error.place >= sum(map(len, members[:hit])) + at


def test_a_bomb_comes_in_small_pieces() -> None:
    bomb = gzip.compress(bytes(64 << 20), compresslevel=9)
    sizes = [len(piece) for piece in inflate([bomb])]
    assert sum(sizes) == 64 << 20
    assert max(sizes) <= 1 << 20


@pytest.mark.parametrize("pack", [lambda data: data, gzip.compress])
def test_what_a_source_knows_of_its_file(tmp_path: Path, pack: type[bytes]) -> None:
    data = pack(TEXT)
    out, source = read(tmp_path / "log", data)
    assert out == TEXT
    assert (source.size, source.digest) == (len(data), hashlib.sha256(data).hexdigest())
    assert (source.packing, source.damage, source.live) == ("gzip" if data != TEXT else "", None, False)
    assert source.form == "candump text" + (", gzip" if data != TEXT else "")
    assert source.length == len(data)


def test_damage_is_kept_with_name_and_place(tmp_path: Path) -> None:
    path = tmp_path / "cut.gz"
    out, source = read(path, PACKED[:-3])
    assert out == TEXT
    assert str(source.damage) == f"{path}: byte {len(PACKED) - 3}: gzip data ends early"


@pytest.mark.parametrize(
    ("head", "what"),
    [
        (b"\xfd7zXZ\0", "xz"),
        (b"BZh9", "bzip2"),
        (b"PK\x03\x04", "zip"),
        (b"\xff\xfe(\0", "UTF-16 text"),
        (b"\xfe\xff\0(", "UTF-16 text"),
    ],
)
@pytest.mark.parametrize("packed", [False, True])
def test_what_is_not_read_is_named(tmp_path: Path, head: bytes, what: str, packed: bool) -> None:
    data = head + bytes(100)
    where = "byte 0 of the unpacked data" if packed else "byte 0"
    with pytest.raises(CaptureError, match=rf": {where}: looks like {what}, which is not read$"):
        read(tmp_path / "log", gzip.compress(data) if packed else data)


@pytest.mark.parametrize(
    ("head", "name", "form"),
    [
        (b"\x89MC", "x", "MCAP"),
        (b"\n\r\r", "x", "pcapng"),
        (b"MDF", "x", "MDF 4"),
        (b"\x89", "x.mcap", "MCAP"),
        (b"\x88MCAP0\r\n", "x.MCAP.gz", "MCAP"),
        (b"garbage\0", "x.blf", "Vector BLF"),
        (b"garbage\0", "x.pcapng.zst", "pcapng"),
        (b"(1.0) can0 1#", "x.mcap", "candump text"),
        (b"; a note", "x.asc", "Vector ASC"),
        (b"date Sat", "x.log", "Vector ASC"),
        (b"  can0  1", "x.bin", "candump text"),
        (b"(", "x", "candump text"),
        (b"", "x", "candump text"),
    ],
)
def test_what_a_capture_is_is_read_from_its_start_then_from_its_name(head: bytes, name: str, form: str) -> None:
    assert detect(head, name).name == form


def test_zstd_that_begins_with_a_frame_to_skip(tmp_path: Path) -> None:
    packed = zstandard.compress(TEXT)
    for head in (b"\x50\x2a\x4d\x18\x04\0\0\0abcd", b"\x5f\x2a\x4d\x18\0\0\0\0"):
        out, source = read(tmp_path / "log", head + packed)
        assert (out, source.packing, source.damage) == (TEXT, "zstd", None)


def test_gzip_inside_gzip_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="byte 0 of the unpacked data: looks like gzip once more"):
        read(tmp_path / "log", gzip.compress(PACKED))


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path: Path) -> None:
    for data in (b"\xef\xbb\xbf" + TEXT, gzip.compress(b"\xef\xbb\xbf" + TEXT)):
        out, source = read(tmp_path / "log", data)
        assert out == TEXT
        assert source.size == len(data)


@pytest.mark.parametrize("size", range(9))
def test_short_files_are_text(tmp_path: Path, size: int) -> None:
    assert read(tmp_path / "log", b"# short\n"[:size])[0] == b"# short\n"[:size]


def test_names_that_cannot_be_opened(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    reasons = {
        "missing": "No such file",
        "file/below": "Not a directory",
        ".": "is a directory",
        "n" * 300: "name too long",
    }
    for name, reason in reasons.items():
        with pytest.raises(CaptureError, match=reason):
            list(Source(str(tmp_path / name)).chunks())
    with pytest.raises(CaptureError, match="null byte"):
        list(Source("a\0b").chunks())


def test_a_source_that_was_stopped_gives_no_more(tmp_path: Path) -> None:
    path = tmp_path / "log"
    whole = TEXT * (4 * CHUNK // len(TEXT))
    path.write_bytes(whole)
    source = Source(str(path))
    chunks = source.chunks()
    given = next(chunks)
    source.stopped = True
    given += b"".join(chunks)
    assert given == whole[: len(given)]
    assert given.endswith(b"\n")
    assert 0 < len(given) < len(whole)
    path.write_bytes(gzip.compress(random.Random(1).randbytes(3 << 20)))
    source = Source(str(path))
    for _ in source.chunks():
        source.stopped = True
    assert source.damage is None  # it is not the file that ends early


def test_a_file_that_is_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whole lines, and an empty chunk whenever nothing is left; an emptied file begins anew, as its digest does."""
    monkeypatch.setattr("analyzer.sources.stored.FOLLOW_PAUSE", 0)
    path = tmp_path / "log"
    path.touch()
    source = Source(str(path), follow=True, hashed=True)
    chunks = source.chunks()

    def until_idle() -> bytes:
        return b"".join(iter(lambda: next(chunks), b""))

    assert until_idle() == b""
    path.write_bytes(b"first line\nhalf of")
    assert until_idle() == b"first line\n"
    assert until_idle() == b""
    with path.open("ab") as file:
        file.write(b" a line, and ha")
    assert until_idle() == b""
    path.write_bytes(b"anew, whole\n")
    assert until_idle() == b"half of a line, and ha <emptied>\nanew, whole\n"
    assert (source.size, source.digest) == (12, hashlib.sha256(b"anew, whole\n").hexdigest())
    path.write_bytes(b"shorter\n")
    assert until_idle() == b"shorter\n"  # the line before was whole
    with path.open("ab") as file:
        file.write(b"last words")
    source.stopped = True
    assert b"".join(chunks) == b""  # nobody knows what else was to be in that line
    assert (source.live, source.damage) == (True, None)
