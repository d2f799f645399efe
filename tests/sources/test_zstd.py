"""Zstandard in every state: whole, cut at each byte, damaged at each byte, and made to burst."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from kit.command import HOVER

from analyzer.sources import CaptureError, Source, UnpackError
from analyzer.sources.zstd import decompress

if TYPE_CHECKING:
    from pathlib import Path

TEXT = HOVER.read_bytes()
SMALL = TEXT[:3000]
SKIPPABLE = bytes.fromhex("502a4d18") + (5).to_bytes(4, "little") + b"extra"
MAGIC = bytes.fromhex("28b52ffd")


def pack(data: bytes, **how: object) -> bytes:
    return zstandard.ZstdCompressor(**how).compress(data)


def stream(data: bytes) -> bytes:
    """As a pipe is packed: the size is not known beforehand, and there is a block for each 200 bytes."""
    packer = zstandard.ZstdCompressor(write_checksum=True).compressobj()
    blocks = [packer.compress(part) + packer.flush(zstandard.COMPRESSOBJ_FLUSH_BLOCK) for part in pieces(data, 200)]
    return b"".join(blocks) + packer.flush()


def pieces(data: bytes, size: int) -> list[bytes]:
    return [data[at : at + size] for at in range(0, len(data), size)]


def unpack(data: bytes, size: int = 1 << 20) -> tuple[bytes, UnpackError | None]:
    """Everything that came out, and the error behind it."""
    out = b""
    try:
        for piece in decompress(pieces(data, size)):
            out += piece
    except UnpackError as error:
        return out, error
    return out, None


def told(error: UnpackError | None) -> tuple[int, str]:
    assert error is not None
    return error.place, error.reason


@pytest.mark.parametrize("size", [1, 7, 4096, 1 << 20])
@pytest.mark.parametrize(
    "packed",
    [
        pack(TEXT),
        pack(TEXT, write_checksum=True),
        pack(TEXT, write_content_size=False),
        pack(TEXT, level=19),
        stream(TEXT),
        stream(TEXT[:100]) + pack(b"") + SKIPPABLE + pack(TEXT[100:]) + SKIPPABLE,
    ],
)
def test_whole_zstd(packed: bytes, size: int) -> None:
    assert unpack(packed, size) == (TEXT, None)


@given(st.binary(max_size=400), st.integers(1, 50), st.integers(0, 400))
def test_any_content_in_any_cut(content: bytes, size: int, split: int) -> None:
    packed = pack(content[:split], write_checksum=True) + stream(content[split:])
    assert unpack(packed, size) == (content, None)


@pytest.mark.parametrize("packed", [stream(SMALL), pack(SMALL), pack(SMALL, write_checksum=True) + SKIPPABLE])
def test_cut_at_every_byte(packed: bytes) -> None:
    whole = {0, len(packed), len(packed) - len(SKIPPABLE) if packed.endswith(SKIPPABLE) else 0}
    for cut in range(len(packed)):
        out, error = unpack(packed[:cut])
        assert SMALL.startswith(out)
        assert (error is None) == (cut in whole)
        assert cut in whole or told(error) == (cut, "zstd data ends early")


def test_blocks_in_front_of_a_cut_are_delivered() -> None:
    packed = stream(SMALL)
    blocks = [unpack(packed[:cut])[0] for cut in range(len(packed))]
    assert {len(out) for out in blocks} == {*range(0, 3000, 200), 3000}


def test_the_sound_part_of_an_uncompressed_block_is_delivered() -> None:
    noise = random.Random(5).randbytes(1000)
    packed = pack(noise)
    assert unpack(packed[:-300])[0] == noise[:-300]


def test_a_flip_of_every_byte() -> None:
    """The checksum finds each change of the text; the blocks before it are as they were."""
    packed = stream(SMALL)
    chance = random.Random(7)
    for at in range(len(packed)):
        damaged = bytearray(packed)
        damaged[at] ^= 1 << chance.randrange(8)
        out, error = unpack(bytes(damaged))
        sound, _ = unpack(packed[:at])
        assert out.startswith(sound)
        if error is None:  # a wider window, say
            assert out == SMALL
        elif at >= 4:
            assert "\n" not in error.reason
            assert error.reason.startswith(("damaged zstd data (", "zstd data ends early"))


@given(st.binary(max_size=200), st.integers(1, 40))
def test_garbage_never_raises_anything_else(garbage: bytes, size: int) -> None:
    for data in (MAGIC + garbage, SKIPPABLE + garbage, pack(b"x") + garbage):
        unpack(data, size)


def test_a_wrong_checksum_is_found_at_its_place() -> None:
    packed = bytearray(pack(TEXT, write_checksum=True))
    packed[-1] ^= 1
    out, error = unpack(bytes(packed))
    assert out == TEXT
    assert told(error) == (len(packed) - 4, "damaged zstd data (restored data doesn't match checksum)")


def test_data_behind_the_end() -> None:
    packed = pack(TEXT)
    out, error = unpack(packed + b"garbage")
    assert out == TEXT
    assert told(error) == (len(packed), "data behind the end of the zstd data")


@pytest.mark.sampled(2)
@pytest.mark.parametrize("step", [1000, 1 << 20])
def test_a_bomb_comes_in_small_pieces(step: int) -> None:
    press = zstandard.ZstdCompressor(level=9).compressobj()
    bomb = b"".join(press.compress(bytes(1 << 20)) for _ in range(256)) + press.flush()
    assert len(bomb) < 20000
    sizes = [len(piece) for piece in decompress(pieces(bomb, step))]
    assert sum(sizes) == 256 << 20
    assert max(sizes) <= (1 << 20) + (1 << 17)


def test_a_window_beyond_128_mib_is_refused() -> None:
    """A frame of 1 GiB that is to be unpacked in one go, and one with the widest window there is."""
    for header in (b"\xa0" + (1 << 30).to_bytes(4, "little"), b"\x00\xf8"):
        out, error = unpack(MAGIC + header + b"\x01\x00\x00")
        assert out == b""
        assert "too much memory" in told(error)[1]


def test_an_empty_piece_is_passed_on() -> None:
    packed = pack(TEXT)
    out = list(decompress([packed[:50], b"", packed[50:], b""]))
    assert out == [b"", TEXT, b""]


def read(path: Path, data: bytes) -> tuple[bytes, Source]:
    path.write_bytes(data)
    source = Source(str(path))
    return b"".join(source.chunks()), source  # type: ignore[arg-type]  # candump text


def test_around_a_capture(tmp_path: Path) -> None:
    out, source = read(tmp_path / "log.zst", pack(TEXT))
    assert (out, source.form, source.damage) == (TEXT, "candump text, zstd", None)
    out, source = read(tmp_path / "log.zst", stream(TEXT)[:-1])
    assert out == TEXT
    assert str(source.damage) == f"{tmp_path / 'log.zst'}: byte {len(stream(TEXT)) - 1}: zstd data ends early"
    with pytest.raises(CaptureError, match="byte 0 of the unpacked data: looks like zstd once more"):
        read(tmp_path / "log.zst", pack(pack(TEXT)))
