"""Calculations in filters are those of whole numbers of any size, as far as floats can tell them apart."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES

import dissectors
from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.filter import compile_filter

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.decode.engine import Batch

LARGE = 0xFFFF_FFFF_FFFF_FFFF
CASES: list[tuple[str, Callable[[int], bool]]] = [
    (f"can.id & {LARGE:#x}", lambda x: x & LARGE != 0),
    ("can.id & 0x8000000000000000", lambda x: x >> 63 == 1),
    (f"{LARGE:#x} & can.id == 0x1f04060a", lambda x: x == 0x1F04060A),
    (f"can.id + {LARGE} > 1", lambda x: x + LARGE > 1),
    (f"can.id - {LARGE} < 1", lambda x: x - LARGE < 1),
    (f"{LARGE} - can.id > 1", lambda x: LARGE - x > 1),
    (f"can.id * {LARGE} > 1", lambda x: x * LARGE > 1),
    (f"can.id / {LARGE} == 0", lambda x: x // LARGE == 0),
    (f"{LARGE} / can.id > 30000000000", lambda x: LARGE // x > 30_000_000_000),
    ("can.id + 9223372036854775807 > 1", lambda x: x + 9223372036854775807 > 1),
    ("can.id * can.id * can.id > 0", lambda x: x**3 > 0),
    ("-9223372036854775807 - can.id < 0", lambda x: -9223372036854775807 - x < 0),
    (f"max(can.id, {LARGE}) > 0x1fffffff", lambda x: max(x, LARGE) > 0x1FFFFFFF),
    (f"min(can.id, {LARGE}) > 0x1f050000", lambda x: min(x, LARGE) > 0x1F050000),
    (f"abs(can.id - {LARGE}) > 5", lambda x: abs(x - LARGE) > 5),
    ("can.id - 0x1f04060a < 0", lambda x: x - 0x1F04060A < 0),
]


@pytest.fixture(scope="module")
def hover() -> list[Batch]:
    return list(Run(Request((str(CAPTURES / "hover.log"),), threads=1)).batches())


@pytest.mark.parametrize(("text", "holds"), CASES)
def test_large_numbers(hover: list[Batch], text: str, holds: Callable[[int], bool]) -> None:
    matcher = compile_filter(text, dissectors.load()).matcher(frame_list=True)
    for batch in hover:
        expected = [holds(one) for one in batch.frames.column("id").to_pylist()]
        assert matcher.feed(batch).frames.tolist() == expected


@pytest.mark.parametrize(("text", "found"), [
    ("image_crc & 0x8000000000000000", True), ("image_crc & 1", False), ("image_crc + 1 > 5", True),
    ("-image_crc < 5", True), ("abs(image_crc) > 5", True), ("image_crc / 2 > 5", True), ("image_crc > 5", True),
    ("max(image_crc) > 5", True), ("image_crc % 3 == 2", True), ("image_crc - 9223372036854775807 < 0", False),
])  # fmt: skip
def test_a_field_of_64_bits(text: str, found: bool) -> None:
    """It is 2**63 there."""
    where = "GetNodeInfo.image_crc > 10 && " + text.replace("image_crc", "GetNodeInfo.software_version.image_crc")
    matcher = compile_filter(where, dissectors.load()).matcher()
    batches = Run(Request((str(CAPTURES / "services.log"),), threads=1)).batches()
    assert any(matcher.feed(batch).transfers.any() for batch in batches) is found


def test_what_no_float_holds_warns_of_nothing(hover: list[Batch]) -> None:
    text = "can.len" + " * 1e18" * 20 + " > 1 || within(can.len, can.len * 1e18, 1e308 %)"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        matcher = compile_filter(text, dissectors.load()).matcher()
        assert all(matcher.feed(batch).transfers.all() for batch in hover)
