"""`plots.toml`: what it says is shown, a mistake is told with file and line; without it every field is shown."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from kit.pictures import draw
from kit.vendors import ACME, PART, PROFILE, PUMP, capture

import dissectors
from dissectors import ProfileError, notes, picture

if TYPE_CHECKING:
    from dissectors import Registry

PLOTS = """\
[quantity]
pressure = { title = "Pressure", unit = "bar" }
flow = { title = "Flow" }

[table.Pump]
line.pressure = { column = "pressure" }
states.state = {}
hidden = ["temperature"]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    vendor = tmp_path / "vendor"
    (vendor / "acme" / "pump").mkdir(parents=True)
    (vendor / "profile.toml").write_text(PROFILE)
    (vendor / "acme" / "pump" / "20777.Pump.uavcan").write_text(PUMP)
    (vendor / "acme" / "pump" / "Part.uavcan").write_text(PART)
    return vendor


def loaded(folder: Path, plots: str | None = None) -> Registry:
    if plots is not None:
        (folder / picture.FILE).write_text(plots)
    return dissectors.load([folder])


def pumped(folder: Path, plots: str | None = None):
    known = loaded(folder, plots)
    return draw(capture(known.signatures(0, ACME)[0]), known=known)


def test_without_the_file_every_field_is_shown_by_its_name(folder: Path) -> None:
    drawn, picture = pumped(folder)
    assert drawn.values("/messages/Pump/pressure/node42") == pytest.approx([1.5, 1.51, 1.52])
    assert drawn.values("/messages/Pump/temperature/node42") == [21.5] * 3
    assert drawn.values("/messages/Pump/state/node42") == ["spinning"]
    assert drawn.values("/messages/Pump/parts/1/value/node42") == [0.0, -1.0, -2.0]
    assert picture.inventory.series["/messages/Pump/pressure/node42"].measure == "bar"
    assert len(drawn.values("/throttle/commanded/esc4")) == 3


def test_with_the_file_quantities_have_plots(folder: Path) -> None:
    drawn, picture = pumped(folder, PLOTS)
    assert drawn.values("/pressure/node42") == pytest.approx([1.5, 1.51, 1.52])
    assert drawn.values("/states/state/node42") == ["spinning"]
    assert {path.split("/")[5] for path in drawn.under("/messages/Pump/parts/")} == {"number", "value"}
    assert drawn.under("/messages/Pump/") == drawn.under("/messages/Pump/parts/")
    series = picture.inventory.series["/pressure/node42"]
    assert (series.quantity, series.measure, series.title) == ("pressure", "bar", "node 42")
    assert picture.pictures.quantities["pressure"].title == "Pressure"


@pytest.mark.parametrize(
    ("wrong", "line", "text"),
    [
        ("[quantity]\nx = { unit = 'V' }\n", 2, "title is missing"),
        ("[quantity]\nx = { title = 'X', color = 1 }\n", 2, "unknown key"),
        ("[table.Pump]\nline.pressure = { column = 'pressure' }\n", 2, "'pressure' is no quantity"),
        ("[quantity]\nx = { title = 'X' }\n[table.Pump]\nline.x = {}\n", 4, "column is missing"),
        ("[quantity]\nx = { title = 'X' }\n[table.Pump]\nproduct.x = { of = ['x'] }\n", 4, "two quantities"),
        ("[quantity]\nx = { title = 'X' }\n[table.Pump]\nproduct.x = { of = ['x', 'x'] }\n", 4, "no line is called"),
        ("[quantity]\nx = { title = 'X' }\n[table.Pump]\nintegral.x = { of = 'x' }\n", 4, "no line is called"),
        ("[table.Pump]\nstates.state = { only = 'tm' }\n", 2, "READING=CHOICE"),
        ("[table.Pump]\nwho = { column = 'a', elements = true }\n", 2, "not by both"),
        ("[table.Pump]\nnonsense = 1\n", 2, "unknown key"),
        ("[nonsense]\n", 1, "unknown key"),
    ],
)  # fmt: skip
def test_a_mistake_is_told_with_file_and_line(folder: Path, wrong: str, line: int, text: str) -> None:
    known = loaded(folder, wrong)
    with pytest.raises(ProfileError, match=text) as told:
        picture.load(known)
    assert (told.value.line, Path(told.value.file).name) == (line, "plots.toml")


def test_the_command_tells_of_it_too(folder: Path, command, tmp_path: Path) -> None:
    known = loaded(folder, "[table.Pump]\nnonsense = 1\n")
    log = tmp_path / "a.log"
    log.write_bytes(capture(known.signatures(0, ACME)[0]))
    status, _, err = command("plot", log, "--dissector", folder)
    assert status == 2
    assert "plots.toml:2" in err
    assert not (tmp_path / "a.rrd").exists()


def test_built_in_files_name_columns_that_exist() -> None:
    known = dissectors.load()
    pictures = picture.load(known)
    for name, plot in pictures.plots.items():
        of = known.definition(name)
        assert of is not None, name
        columns = {column for column, _ in notes.columns(of.layout, of.notes)} | {one.name for one in of.derived}
        columns |= {f"{field}.unwrapped" for field, note in of.notes.items() if note.wraps}
        asked = {line.column for line in plot.lines} | {one.column for one in plot.states} | plot.hidden
        asked |= {plot.who.column} - {""}
        assert asked <= columns, name


def test_the_first_folder_wins_a_table(folder: Path) -> None:
    known = loaded(folder, "[table.ESCStatus]\nwho = { path = 'mine' }\n")
    assert picture.load(known).plots["ESCStatus"].who.path == "mine"
