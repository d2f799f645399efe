"""The native renderer of rows: single values as Python writes them, digit for digit and escape for escape."""

from __future__ import annotations

import csv
import io
import json
import struct
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from kit.strategies import examples

from analyzer import _native
from analyzer.facts.json_number import number
from analyzer.views.json_fields import text_of
from analyzer.views.members import PLAIN
from analyzer.views.records import harmless
from analyzer.views.sheets import SheetColumns, flat
from analyzer.views.times import MODES, TimeFormat
from analyzer.views.values import value_format
from analyzer.views.wording import formatter, plain

JSON = ("number", PLAIN, ("json", "false", "true", True))
# Every pattern of bits, those that people write, and halves that a float32 came from.
FLOATS = (
    st.floats()
    | st.integers(0, 2**64 - 1).map(lambda bits: struct.unpack("<d", struct.pack("<Q", bits))[0])
    | st.decimals(-100_000, 100_000, places=4).map(float)
    | st.floats(width=32)
    | st.floats(width=16)
)
TEXTS = st.text(st.characters(exclude_categories=("Cs",))) | st.text(
    "\"',;\\\r\n\t\x00\x1b\x7f\x9b=+-@ aé\u202e\U0001f600"
)


def written(template: tuple[Any, ...], *cells: Any, kind: pa.DataType | None = None) -> list[str]:
    """Return what a template writes of each cell of one column."""
    column = pa.array(cells, kind)
    made = _native.Template([("of", 0, template)])
    sheet = _native.Sheet(made, [flat(column)], [], [], 0, np.arange(len(column), dtype=np.uint32))
    return sheet.texts(0, len(column))


@examples(300)
@given(st.lists(TEXTS, min_size=1))
def test_texts_of_a_capture_are_escaped_as_python_does(texts: list[str]) -> None:
    assert written(("json",), *texts) == [text_of(text) for text in texts]
    assert written(("copy",), *texts) == texts
    for text, cell in zip(texts, written(("csv", ("copy",)), *texts), strict=True):
        out = io.StringIO()
        csv.writer(out).writerow([harmless(text), "next"])
        assert cell + ",next\r\n" == out.getvalue()


@examples(500)
@given(st.lists(FLOATS, min_size=1))
def test_floats_are_those_of_python(values: list[float]) -> None:
    assert written(JSON, *values) == [json.dumps(number(value)) for value in values]
    assert written(("number", PLAIN, ("plain",)), *values) == [plain(value) for value in values]


@examples(100)
@given(st.lists(st.integers(0, 65535), min_size=1), st.sampled_from([("1", "100"), ("9", "8191"), ("360", "16384")]))
def test_scales_are_undone_and_done_exactly(raws: list[int], scale: tuple[str, str]) -> None:
    over, under = map(float, scale)
    shown = [raw * over / under for raw in raws]
    unscaled = ((over, under, True), None, None, False)
    assert written(("number", unscaled, JSON[2]), *shown) == [str(raw) for raw in raws]
    scaled = (None, (3, 5), (over, under), False)
    wanted = [json.dumps((raw >> 3 & 31) * over / under) for raw in raws]
    assert written(("number", scaled, JSON[2]), *raws, kind=pa.uint16()) == wanted


@examples(300)
@given(
    st.lists(
        st.integers(-(2**63), 2**64 - 1) | FLOATS.filter(lambda one: abs(one) < 2**127) | st.booleans(), min_size=1
    ),
    st.from_regex(r"[<>^]?[+ -]?0?\d{0,2}(\.\d)?[dxXefg]", fullmatch=True),
)
def test_formats_are_those_of_python(values: list[float], spec: str) -> None:
    assume("." not in spec or spec[-1] not in "dxX")  # which Python refuses, and a profile with it
    kinds = {bool: pa.bool_(), float: pa.float64()}
    for value in values:
        kind = kinds.get(type(value), pa.uint64() if value >= 0 else pa.int64())
        shown = value_format(spec)
        assert shown is not None
        assert written(("number", PLAIN, shown), value, kind=kind) == [formatter(spec, {})(value)]


@pytest.mark.parametrize("cells", [[1, None, 3], [True, False, None], [1.5, None], ["a", None, ""], [[1, 2], [], None]])
@pytest.mark.parametrize("cut", [(0, None), (1, None), (1, 1)])
def test_cells_of_slices_and_missing_ones(cells: list[Any], cut: tuple[int, int | None]) -> None:
    column = pa.array([cells[0], *cells]).slice(1).slice(*cut)
    lists = ("all", [("text", "["), ("each", ",", 9, "", JSON), ("text", "]")])
    inner = {str: ("json",), list: lists}.get(type(cells[0]), JSON)
    made = _native.Template([("of", 0, ("or", "null", inner))])
    sheet = _native.Sheet(made, [flat(column)], [], [], 0, np.arange(len(column), dtype=np.uint32))
    assert sheet.texts(0, len(column)) == [text_of(one) for one in column.to_pylist()]


@pytest.mark.parametrize("digits", [6, 9])
@pytest.mark.parametrize("mode", MODES)
@examples(30)
@given(batches=st.lists(st.lists(st.none() | st.integers(-(2**61), 2**61)), min_size=1, max_size=3))
def test_times_are_those_of_the_list(mode: str, digits: int, batches: list[list[int | None]]) -> None:
    clock = TimeFormat(mode, 1_700_000_000_000_000_001, digits)
    for times in batches:
        array = pa.array(times, pa.int64())
        elapsed, (days, seconds) = clock.elapsed(array), clock.days(array)
        columns = SheetColumns(pa.schema([("elapsed", pa.int64()), ("days", pa.uint32())]), "elapsed", "days")
        made = _native.Template([clock.template(columns, 0)])
        rows = np.arange(len(times), dtype=np.uint32)
        sheet = _native.Sheet(made, [flat(elapsed), flat(days)], [], [seconds], 0, rows)
        wanted = [clock.written(elapsed, days, seconds, row) for row in range(len(times))]
        assert sheet.texts(0, len(times)) == wanted


@pytest.mark.parametrize(
    ("word", "width", "low", "high", "shown"),
    [
        (0x8001, 16, 0, 0, ".... .... .... ...1"),
        (0x8001, 16, 12, 15, "1000 .... .... ...."),
        (0x1F000000, 29, 24, 28, "1 1111 .... .... .... .... .... ...."),
        (5, 3, 0, 2, "101"),
    ],
)
def test_pictures_of_bits(word: int, width: int, low: int, high: int, shown: str) -> None:
    assert written(("bits", PLAIN, width, low, high), word) == [shown]


def test_a_template_that_does_not_exist_is_told() -> None:
    with pytest.raises(ValueError, match='no template "none"'):
        _native.Template([("none",)])
