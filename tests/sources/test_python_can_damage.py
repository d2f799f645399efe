"""Captures of python-can's formats cut at each byte and changed at each byte: one clear line, and all before it."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.libraries import TEXT, frames, library_file, pieces_of
from kit.rows import EXTENDED, RX, TX, Frame, Record, events, records

from analyzer.sources import CaptureError, Source

if TYPE_CHECKING:
    from analyzer._native import FrameBatch

T0 = 1_700_000_000_000_000_000
SUFFIXES = (*TEXT, ".blf")
FOUND: list[Record] = [
    Frame(T0 + row * 1_000_000, "can0", 0x05040601 + row, EXTENDED | (TX if row % 3 else RX), bytes(range(row % 9)))
    for row in range(12)
]
WHOLE = {suffix: library_file(suffix, FOUND) for suffix in SUFFIXES}
WORDS = "0 1 2 8 9 . , ; = x d r Rx Tx DT FD ER 1.5 CANFD ErrorFrame 7FF AA -1 1e9 base dec"
EXPECTED = {suffix: frames(suffix, data) for suffix, data in WHOLE.items()}


def attempt(suffix: str, data: bytes) -> tuple[list[FrameBatch], Source | None]:
    """Nothing but `CaptureError` may be raised; every text is one printable line."""
    pieces: list[FrameBatch] = []
    source, told = None, ""
    try:
        pieces, source = pieces_of(suffix, data)
    except CaptureError as error:
        told = str(error)
    texts = [text for _, _, text in events(pieces, "unreadable")]
    assert all(len(text) < 200 for text in texts)
    assert all(text.isprintable() for text in (*texts, told, str(source and source.damage)))
    return pieces, source


@pytest.mark.slow
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_cut_at_every_byte(suffix: str) -> None:
    data, expected = WHOLE[suffix], EXPECTED[suffix]
    counts = []
    for cut in range(len(data)):
        pieces, source = attempt(suffix, data[:cut])
        found = records(pieces)
        assert found == expected[: len(found)]
        counts.append(len(found))
        if suffix == ".blf" and source is not None and cut > 32:
            assert str(source.damage) == f"capture.blf: byte {cut}: BLF data ends early"
    assert counts == sorted(counts)
    if suffix in TEXT:
        assert {*counts} == {*range(len(expected) + (suffix != ".csv"))}  # a cut line of CSV never counts


@pytest.mark.slow
def test_a_cut_container_gives_what_it_holds() -> None:
    """Not compressed, and compressed with noise so that the text comes bit by bit."""
    noise = random.Random(3)
    many = [Frame(T0 + row * 1000, "can0", row, RX, noise.randbytes(8)) for row in range(400)]
    for level in (0, 9):
        data = library_file(".blf", many, compression_level=level)
        counts = [len(frames(".blf", data[:cut])) for cut in range(144, len(data), 97)]
        assert counts == sorted(counts)
        assert len({*counts}) > 20
        found = frames(".blf", data[:-500])
        assert found == many[: len(found)]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_change_of_every_byte(suffix: str) -> None:
    data, expected = WHOLE[suffix], EXPECTED[suffix]
    chance = random.Random(suffix)
    for at in range(len(data)):
        damaged = bytearray(data)
        damaged[at] ^= 1 << chance.randrange(8)
        pieces, _ = attempt(suffix, bytes(damaged))
        found = records(pieces)
        if suffix in TEXT and at > 600:
            same = sum(record in expected for record in found)
            assert same >= len(expected) - 2  # the line itself, and the next if it was the line end
        sound = frames(suffix, data[:at]) if suffix in TEXT and at > 600 else []
        assert found[: max(0, len(sound) - 1)] == sound[:-1]


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(st.data())
def test_damage_of_any_kind(suffix: str, data: st.DataObject) -> None:
    whole = WHOLE[suffix]
    start = data.draw(st.integers(0, len(whole)))
    end = data.draw(st.integers(start, min(len(whole), start + 100)))
    attempt(suffix, whole[:start] + data.draw(st.binary(max_size=60)) + whole[end:])


@pytest.mark.parametrize("suffix", TEXT)
@given(st.lists(st.sampled_from(WORDS.split(" "))))
def test_any_words(suffix: str, words: list[str]) -> None:
    head = WHOLE[suffix].splitlines(keepends=True)
    body = head[len(head) // 2]
    attempt(suffix, b"".join(head[:-3]) + " ".join(words).encode() + b"\n" + body)
    attempt(suffix, b"".join(head[:-3]) + ",".join(words).encode() + b"\n" + body)
