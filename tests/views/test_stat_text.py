"""Statistics on a terminal: they fit, columns go and come with the width, bars are as long as they should be."""

from __future__ import annotations

import pytest

from analyzer.stats.table import StatColumn, StatTable
from analyzer.views.stats.text import StatText
from analyzer.views.terminal import display_width

START = 1_700_000_000 * 10**9
COLUMNS = (
    StatColumn("bus", "Bus", "text"),
    StatColumn("name", "Name", "text"),
    StatColumn("secret", "Secret", "text", rank=-1),
    StatColumn("count", "Count", bar=True),
    StatColumn("share", "%", "number", 1),
    StatColumn("since", "Since", "time", rank=1),
    StatColumn("long", "Long", "text", rank=2),
    StatColumn("up", "Up", "span"),
)
ROWS = [
    ("can0", "node\x1b[31m", "x", 100, 50.0, START + 10**9, "y" * 60, 3661),
    ("can1", "name " * 30, "x", 50, 25.04, None, "y" * 60, 59),
    ("can1", "z", "x", 0, 0.0, START, "y" * 60, None),
]
TABLE = StatTable(
    "things", "about " * 30, COLUMNS, ROWS, ["note " * 40], total=("", "all", "", 150, None, None, "", None)
)


@pytest.mark.parametrize("width", [40, 80, 97, 130, 200])
def test_it_fits(width: int) -> None:
    lines = list(StatText(width, START, START + 10**10).table(TABLE, buses=2))
    assert max(map(display_width, lines)) <= width
    assert not any("\x1b" in line for line in lines)
    assert any("\\x1b[31m" in line for line in lines) or width == 40


def test_what_has_no_room_is_named() -> None:
    narrow, wide = ("\n".join(StatText(width, START, None).table(TABLE, buses=2)) for width in (80, 400))
    assert "  a wider terminal shows more columns: Since, Long" in narrow
    assert "yyyy" not in narrow
    assert "a wider terminal" not in wide
    assert "y" * 60 in wide
    assert "Secret" not in narrow + wide


def test_the_bus_is_named_if_there_are_several() -> None:
    texts = ["\n".join(StatText(80, START, None).table(TABLE, buses=buses)) for buses in (1, 2)]
    assert ["can1" in text for text in texts] == [False, True]


def test_bars_are_shares_of_the_longest() -> None:
    table = StatTable("t", "a", COLUMNS[1:2] + COLUMNS[3:4], [(str(n), n) for n in (0, 1, 40, 80)])
    lines = list(StatText(80, None, None).table(table, buses=1))[2:]
    bars = ["".join(line.split()[2:]) for line in lines]
    assert bars[0] == ""
    assert bars[1] == "▊"
    assert 2 * bars[2].count("█") == bars[3].count("█") == 60


def test_cells() -> None:
    lines = list(StatText(400, START, START + 10**10).table(TABLE, buses=2))
    words = lines[-4].split()
    assert "1:01:01" in lines[-5]
    assert "0:00:59" in words
    assert "25.0" in words
    no_date = list(StatText(400, 10**9, 2 * 10**9).table(TABLE, buses=2))
    assert any("1699999999.000 s" in line for line in no_date)


def test_nothing_is_said_to_be_nothing() -> None:
    lines = list(StatText(80, None, None).table(StatTable("t", "a", COLUMNS, [], ["why"]), buses=1))
    assert lines == ["t  a", "  nothing", "  why"]


def test_rows_left_out_between_others_are_counted() -> None:
    table = StatTable("t", "a", COLUMNS[3:4], [(n,) for n in range(9)], shown=(0, 1, 7, 8), gaps="without a frame")
    lines = list(StatText(40, None, None).table(table, buses=1))
    assert "  ... 5 without a frame" in lines
