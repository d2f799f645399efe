"""Tables as text: what fits, what gives way, how lines are shared; and numbers as short texts."""

from __future__ import annotations

import time

import pytest

from analyzer.terminal import figures
from analyzer.terminal.bar import bottom, top
from analyzer.terminal.heights import share
from analyzer.terminal.sheet import Cell, Fitting, Sorting, TableColumn, TextTable, head, lines, text_cell
from analyzer.views.terminal import display_width

MS, SECOND = 1_000_000, 1_000_000_000
COLUMNS = (
    TableColumn("a", rank=0, least=4),
    TableColumn("bb", rank=2, least=6),
    TableColumn("text", right=False, rank=0, grow=True, least=5),
    TableColumn("c", rank=1, least=3),
)


def row(*texts: str) -> tuple[Cell, ...]:
    return tuple(Cell(text, value=text) for text in texts)


def drawn(sheet: TextTable, width: int, fitting: Fitting | None = None, sorting: Sorting | None = None) -> list[str]:
    fitted = (fitting or Fitting()).fit(sheet, width)
    shown = [head(sheet, fitted, width, sorting or Sorting(), "head"), *lines(sheet, fitted, sheet.rows, width)]
    return ["".join(text for text, _ in line) for line in shown]


@pytest.mark.parametrize("width", [1, 5, 10, 13, 20, 21, 40, 200])
def test_every_line_is_as_wide_as_the_terminal(width: int) -> None:
    sheet = TextTable(
        COLUMNS, (row("1", "22", "a long text that does not fit", "3"), row("1", "2", "日本語の名前です", "3"))
    )
    assert {display_width(line) for line in drawn(sheet, width)} == {width}


def test_columns_of_a_higher_rank_give_way_first() -> None:
    sheet = TextTable(COLUMNS, (row("1", "2", "x", "3"),))
    seen = {width: [COLUMNS[k].head for k, _ in Fitting().fit(sheet, width)] for width in (10, 14, 21)}
    assert seen == {10: ["a", "text"], 14: ["a", "text", "c"], 21: ["a", "bb", "text", "c"]}


def test_what_is_left_goes_to_the_column_that_grows() -> None:
    sheet = TextTable(COLUMNS, (row("1", "2", "x" * 50, "3"),))
    assert dict(Fitting().fit(sheet, 40))[2] == 40 - 4 - 6 - 3 - 3
    assert "x" * 23 + "…" in drawn(sheet, 40)[1]


def test_columns_do_not_move_when_numbers_become_shorter() -> None:
    fitting = Fitting()
    wide = fitting.fit(TextTable(COLUMNS, (row("123456789", "2", "x", "3"),)), 60)
    assert fitting.fit(TextTable(COLUMNS, (row("1", "2", "x", "3"),)), 60) == wide
    assert fitting.fit(TextTable(COLUMNS, (row("1", "2", "x", "3"),)), 61) != wide


def test_long_heads_are_used_where_there_is_room() -> None:
    sheet = TextTable((TableColumn("V", least=5, long="Voltage V"),), (row("1"),))
    assert drawn(sheet, 5)[0] == "    V"
    assert drawn(sheet, 20)[0].startswith("Voltage V")


def test_sorting_goes_through_the_columns_and_back_to_the_tables_own_order() -> None:
    sheet = TextTable(COLUMNS, (row("1", "2", "x", "3"),))
    sorting, seen = Sorting(), []
    for _ in range(5):
        sorting.next(sheet)
        seen.append(sorting.column)
    assert seen == ["a", "bb", "text", "c", ""]


def test_rows_are_sorted_by_value_and_those_without_one_come_last() -> None:
    cells = [Cell("9", value=9.0), Cell("-", value=None), Cell("10", value=10.0), Cell("-3", value=-3.0)]
    sheet = TextTable((TableColumn("a"),), tuple((cell,) for cell in cells))
    assert [one[0].text for one in Sorting("a").sorted(sheet).rows] == ["-3", "9", "10", "-"]
    assert [one[0].text for one in Sorting("a", down=True).sorted(sheet).rows] == ["10", "9", "-3", "-"]
    assert [one[0].text for one in Sorting("", down=True).sorted(sheet).rows] == ["-3", "10", "-", "9"]


def test_the_column_that_is_sorted_by_is_marked() -> None:
    sheet = TextTable(COLUMNS, (row("1", "2", "x", "3"),))
    assert drawn(sheet, 40, sorting=Sorting("bb"))[0].split()[:2] == ["a", "bb^"]
    assert drawn(sheet, 40, sorting=Sorting("bb", down=True))[0].split()[:2] == ["a", "bbv"]


def test_text_of_the_bus_cannot_command_a_terminal() -> None:
    cell = text_cell("a\x1b[31m\u202e\nb\x9b")
    assert cell.text == "a\\x1b[31m\\u202e\\x0ab\\x9b"
    assert cell.text.isprintable()


@pytest.mark.parametrize("total", range(40))
def test_all_lines_are_given_and_never_more(total: int) -> None:
    given = share(total, {"buses": 1, "devices": 8, "nodes": 10, "findings": 5, "latched": 30}, "devices")
    assert sum(given.values()) == total


def test_eight_devices_are_seen_on_the_smallest_terminal() -> None:
    wanted = {"buses": 1, "devices": 8, "nodes": 10, "findings": 20, "latched": 30}
    for focus in wanted:
        given = share(22, wanted, focus)
        assert min(given.values()) >= 1
    given = share(22, wanted, "devices")
    assert given["devices"] == 9
    assert given["buses"] == 2
    assert given["findings"] >= 3


def test_the_pane_in_use_gets_what_it_needs_before_others() -> None:
    wanted = {"buses": 1, "devices": 8, "nodes": 10, "findings": 20, "latched": 30}
    assert share(22, wanted, "nodes")["nodes"] == 11
    assert share(22, wanted, "findings")["findings"] > 10


def test_lines_that_nobody_needs_go_to_the_last_pane() -> None:
    assert share(48, {"buses": 1, "devices": 1, "latched": 1}, "devices") == {"buses": 2, "devices": 2, "latched": 44}


@pytest.mark.parametrize(
    ("ns", "text"),
    [
        (None, "-"), (0, "0ms"), (33 * MS, "33ms"), (999_999_999, "999ms"), (1_240 * MS, "1.2s"), (45 * SECOND, "45s"),
        (119 * SECOND, "119s"), (720 * SECOND, "12m"), (3 * 3600 * SECOND, "3h"), (50 * 3600 * SECOND, "2d"),
    ],
)  # fmt: skip
def test_spans(ns: int | None, text: str) -> None:
    assert figures.span(ns) == text


@pytest.mark.parametrize(("ns", "text"), [(None, "-"), (99 * MS, "<0.1s"), (480 * MS, "0.4s"), (1_240 * MS, "1.2s")])
def test_ages(ns: int | None, text: str) -> None:
    assert figures.age(ns) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0, "0"), (99_999, "99999"), (123_456, "123k"), (1_234_567, "1.2M"), (12_345_678, "12.3M"), (3.2e9, "3.2G")],
)
def test_amounts(value: int, text: str) -> None:
    assert figures.amount(value) == text
    assert len(text) <= 5


def test_numbers_sizes_rates_and_durations() -> None:
    assert [figures.number(v) for v in (None, 46.12, -3071.4, 2e6)] == ["-", "46.1", "-3071", "2.0M"]
    assert figures.number(71.0, whole=True) == "71"
    assert [figures.size(n) for n in (12, 12_345, 12_345_678)] == ["12B", "12.3kB", "12.3MB"]
    assert [figures.rate(v) for v in (0, 0.5, 6, 402.4)] == ["0", "0.5", "6.0", "402"]
    assert [figures.bits(v) for v in (1_000_000, 500_000, 83_333)] == ["1M", "500k", "83.333k"]
    assert [figures.duration(s) for s in (None, 12, 3723, 183_840)] == ["-", "0:12", "1:02:03", "2d 03:04"]


@pytest.mark.parametrize(("t", "text"), [(-(1 << 63), "--:--:--"), (-1, "--:--:--"), ((1 << 63) - 1, "23:47:16")])
def test_times_of_day(t: int, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    assert figures.clock(t) == text


def test_the_first_line_waits_and_the_last_one_shows_what_fits() -> None:
    assert "waiting" in top(None, None, 80)[0][0]
    for width in (10, 60, 80, 200):
        line = "".join(text for text, _ in bottom("", width))
        assert len(line) == width
        assert line.startswith(" ? help"[:width].rstrip()) or width == 10
    assert "".join(text for text, _ in bottom("saved\x1b", 20)) == " saved\\x1b          "
