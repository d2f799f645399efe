"""Fewer lines that still show the same: which ones are left, and how often that is tried."""

from __future__ import annotations

import pytest

from analyzer.rules.extract.shrink import Shrinker


def line(number: int, node: int, kind: int = 0x1F0409, bus: str = "can0") -> bytes:
    return f"({number:06d}.000000) {bus} {kind << 8 | node:08X}#0{number % 10}\n".encode()


def shrunk(lines: list[bytes], needed: set[bytes], trials: int = 96) -> tuple[list[bytes], int]:
    tried = 0

    def shows(text: bytes) -> bool:
        nonlocal tried
        tried += 1
        return needed <= set(text.splitlines(keepends=True))

    return Shrinker(shows, trials).shrink(lines), tried


@pytest.mark.parametrize("needed", [{0}, {999}, {500}, {3, 997}, {10, 11, 12}, {200, 600}])
def test_only_what_is_needed_is_left(needed: set[int]) -> None:
    lines = [line(k, 10 + k % 5) for k in range(1000)]
    wanted = {lines[k] for k in needed}
    left, tried = shrunk(lines, wanted)
    assert wanted <= set(left)
    assert len(left) <= 8
    assert left == [one for one in lines if one in set(left)], "in their order"
    assert tried <= 96


def test_the_frames_of_others_go_first() -> None:
    lines = [line(k, 11 if k % 10 else 12) for k in range(200)]
    left, _ = shrunk(lines, {lines[10], lines[190]}, trials=2)
    assert {one.split()[2][:8] for one in left} == {b"1F04090C"}


def test_error_frames_and_short_identifiers_are_senders_of_their_own() -> None:
    error, short = b"(000001.000000) can0 20000288#0000\n", b"(000002.000000) can0 123#11\n"
    lines = [error, short, line(3, 0x08), line(4, 0x23)]
    for one in lines:
        assert shrunk(lines, {one})[0] == [one]


def test_the_trials_are_counted_and_the_result_is_always_one_that_shows_it() -> None:
    lines = [line(k, 10 + k % 5) for k in range(1000)]
    wanted = set(lines[::100])
    for trials in (0, 1, 7, 30):
        left, tried = shrunk(lines, wanted, trials)
        assert tried <= trials
        assert wanted <= set(left)
    assert shrunk(lines, wanted, 0)[0] == lines


def test_the_work_is_bounded_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analyzer.rules.extract.shrink.MOST_WORK", 2500)
    judged = 0

    def shows(text: bytes) -> bool:
        nonlocal judged
        judged += text.count(b"\n")
        return False

    Shrinker(shows).shrink([line(k, 10) for k in range(1000)])
    assert 2000 < judged <= 2500
