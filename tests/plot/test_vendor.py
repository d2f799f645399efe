"""A folder of one's own with a `plots.toml`: its tables are named as people name messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import dissectors
from dissectors import ProfileError, picture

if TYPE_CHECKING:
    from pathlib import Path

QUANTITY = '[quantity]\npressure = { title = "Pressure", unit = "hPa" }\n'


def folder(path: Path, plots: str) -> Path:
    path = path / "acme"
    path.mkdir()
    (path / "20900.Pump.uavcan").write_text("uint16 pressure\nuint8 number\n")
    (path / "plots.toml").write_text(QUANTITY + plots)
    return path


@pytest.mark.parametrize("name", ["Pump", "acme.Pump", '"acme.Pump"', "pump"])
def test_a_table_is_found_by_any_of_its_names(tmp_path: Path, name: str) -> None:
    name = name if name.startswith('"') else f'"{name}"'
    plots = f'[table.{name}]\nwho = {{ column = "number" }}\nline.pressure = {{ column = "pressure" }}\n'
    registry = dissectors.load([folder(tmp_path, plots)])
    found = picture.load(registry).plots[registry.resolve("Pump").table]
    assert [(line.quantity, line.column) for line in found.lines] == [("pressure", "pressure")]
    assert found.who.column == "number"
    assert found.table == registry.resolve("Pump").table


def test_packets_stand_behind_the_message_that_carries_them(tmp_path: Path) -> None:
    found = picture.load(dissectors.load([folder(tmp_path, '[table."pushcan.MotorStatus"]\nparameters = true\n')]))
    assert found.plots["PUSHCAN.MotorStatus"].parameters  # the folder comes before the built-in one


@pytest.mark.parametrize(
    ("plots", "reason"),
    [
        ("[table.Pumb]\n", "plots.toml:3: [table.Pumb] no message is called 'Pumb' (near: Pump)"),
        ('[table."Pumb.Packet"]\n', "no message is called 'Pumb.Packet'"),
    ],
)
def test_mistakes_are_told_with_their_place(tmp_path: Path, plots: str, reason: str) -> None:
    with pytest.raises(ProfileError) as error:
        picture.load(dissectors.load([folder(tmp_path, plots)]))
    assert reason in str(error.value)
