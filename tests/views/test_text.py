"""Texts of a capture cannot reach the terminal, columns fit, and times are exact."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analyzer.tables import FRAMES, TRANSFER_ANOMALIES
from analyzer.views import times
from analyzer.views.terminal import ELLIPSIS, Palette, display_width, escape, fit
from analyzer.views.times import TimeFormat
from analyzer.views.wording import anomalies, formatter, plain
from dissectors.kit.cells import pylist

if TYPE_CHECKING:
    from collections.abc import Iterator

T0 = 1_773_475_330_600_000_000  # 2026-03-14 08:02:10.6 UTC


@pytest.fixture
def paris(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("TZ", "Europe/Paris")
    time.tzset()
    times._day.cache_clear()
    yield
    monkeypatch.undo()
    time.tzset()
    times._day.cache_clear()


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("can0 µ 漢", "can0 µ 漢"),
        ("\x1b[2J", "\\x1b[2J"),
        ("a\x07\r\n\tb\x7f\x9b", "a\\x07\\x0d\\x0a\\x09b\\x7f\\x9b"),
        ("x\u202egpj", "x\\u202egpj"),
        ("\u200b\ufeff\u2066\u00a0", "\\u200b\\ufeff\\u2066\\xa0"),
        ("\U000e0041", "\\U000e0041"),
        (b"can\xff\xc3\xa9", "can\\xffé"),
    ],
)
def test_escape(text: str | bytes, shown: str) -> None:
    assert escape(text) == shown


@given(st.text() | st.binary())
def test_nothing_unprintable_gets_out(text: str | bytes) -> None:
    assert escape(text).isprintable()


@given(st.text(st.characters(exclude_categories=("C", "Z", "M"))), st.integers(0, 30))
def test_fit_never_overflows(text: str, width: int) -> None:
    cut = fit(text, width)
    assert display_width(cut) <= width
    assert cut == text or width == 0 or (cut.endswith(ELLIPSIS) and text.startswith(cut[:-1]))


def test_wide_characters_take_two_columns() -> None:
    assert fit("漢字漢字", 5) == "漢字…"
    assert fit("漢字漢字", 8) == "漢字漢字"
    assert display_width("e\u0301") == 1


def test_colours_only_when_asked() -> None:
    assert Palette().paint("bad", "x") == "x"
    assert Palette(True).paint("bad", "x") == "\x1b[31mx\x1b[0m"


def column(clock: TimeFormat, times: list[int | None], picked: list[int] | None = None) -> list[str]:
    """Return what stands in the time column of the picked rows (all if not given) of a batch."""
    array, rows = pa.array(times, pa.int64()), np.arange(len(times)) if picked is None else np.array(picked)
    elapsed, (days, seconds) = clock.elapsed(array, rows), clock.days(array)
    return [clock.written(elapsed, days, seconds, int(row)) for row in rows]


@pytest.mark.parametrize(
    ("mode", "shown"),
    [
        ("e", "1773475330.600000"),
        ("u", "08:02:10.600000"),
        ("ud", "2026-03-14 08:02:10.600000"),
        ("a", "09:02:10.600000"),
        ("ad", "2026-03-14 09:02:10.600000"),
        ("r", "0.000000"),
    ],
)
@pytest.mark.usefixtures("paris")
def test_time_modes(mode: str, shown: str) -> None:
    clock = TimeFormat(mode, digits=6)
    clock.start(_frames([None, T0]))
    assert column(clock, [T0, None]) == [clock.text(T0), clock.text(None)] == [shown, ""]
    assert [clock.next(T0), clock.next(None)] == [shown, ""]


def test_relative_times_are_exact_and_signed_around_an_anchor() -> None:
    clock = TimeFormat("r", zero=T0, digits=9)
    assert column(clock, [T0 - 1, T0, T0 + 3_600_000_000_001]) == ["-0.000000001", "+0.000000000", "+3600.000000001"]
    plain_clock = TimeFormat("r")
    plain_clock.start(_frames([T0]))
    assert column(plain_clock, [T0 - 3_791_000, T0 + 17_288_123_456_789]) == ["-0.003791", "17288.123456"]


def test_delta_counts_hidden_rows_and_delta_displayed_does_not() -> None:
    times = [T0, T0 + 1000, None, T0 + 5000, T0 + 4000]
    delta, shown = TimeFormat("d", digits=6), TimeFormat("dd", digits=6)
    assert column(delta, times) == ["0.000000", "0.000001", "", "0.000004", "-0.000001"]
    assert column(shown, times, [0, 3, 2, 4]) == ["0.000000", "0.000005", "", "-0.000001"]
    # The next batch goes on where this one ended.
    assert column(delta, [T0 + 9000]) == ["0.000005"]
    assert column(shown, [T0 + 9000]) == ["0.000005"]


@pytest.mark.parametrize(("times", "digits"), [([T0, T0 + 1000], 6), ([None, T0, T0 + 1], 9)])
def test_decimals_follow_the_capture(times: list[int | None], digits: int) -> None:
    clock = TimeFormat("e")
    clock.start(_frames(times))
    assert len(clock.text(T0).partition(".")[2]) == digits


def test_unknown_mode_is_told() -> None:
    with pytest.raises(ValueError, match="no time format 'x'"):
        TimeFormat("x")


def _frames(times: list[int | None]) -> pa.RecordBatch:
    rows = [dict.fromkeys(FRAMES.names, 0) | {"t": t, "data": b""} for t in times]
    return pa.RecordBatch.from_pylist(rows, schema=FRAMES)


@pytest.mark.parametrize(
    ("value", "spec", "shown"),
    [
        (5.0, "", "5"),
        (-0.0, "", "-0"),
        (25.203125, "", "25.20312"),
        (float("nan"), ".1f", "NaN"),
        (float("-inf"), "d", "-Infinity"),
        (3.9, "d", "3"),
        (255, "04X", "00FF"),
        (None, ".1f", "-"),
        (True, "", "yes"),
        ([1, None, 3], "d", "1 - 3"),
        ("text", "d", "text"),
        ({"a": 1, "b": None}, "x", "{a 1}"),
    ],
)
def test_formats_never_fail(value: object, spec: str, shown: str) -> None:
    assert formatter(spec, {})(value) == shown


def test_named_values_print_their_name() -> None:
    assert [formatter("02X", {255: "all"})(v) for v in (255, 254)] == ["all", "FE"]
    assert plain(b"\x01\xff") == "01 FF"


def test_every_anomaly_has_words_of_its_own() -> None:
    words = [anomalies(1 << bit) for bit in range(len(TRANSFER_ANOMALIES))]
    assert all(len(word) == 1 for word in words)
    assert len({word[0] for word in words}) == len(TRANSFER_ANOMALIES)
    assert anomalies(1 << TRANSFER_ANOMALIES.index("transfer id gap"), 5) == ["transfer ID skips (+5 instead of +1)"]


@pytest.mark.parametrize(
    "array",
    [
        pa.array([1, None, 3], pa.uint8()),
        pa.array([True, None, False]),
        pa.array([1.5, None], pa.float32()),
        pa.array([b"", b"\x01\x02", None]),
        pa.array(["a", None]),
        pa.array([[1, 2], None, []], pa.list_(pa.int16())),
        pa.array([{"a": 1, "b": [True]}, None, {"a": None, "b": None}]),
        pa.array([{}, None, {}], pa.struct([])),
        pa.array([[{"x": 1}], None], pa.list_(pa.struct([("x", pa.int64())]))),
        pa.array([], pa.list_(pa.uint8())),
    ],
    ids=lambda a: str(a.type),
)
def test_columns_become_the_lists_that_arrow_gives(array: pa.Array) -> None:
    assert pylist(array) == array.to_pylist()
    assert pylist(array[1:]) == array[1:].to_pylist()
