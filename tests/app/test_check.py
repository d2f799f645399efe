"""`analyzer.check`, by the names that its arguments have and had."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit.command import CAPTURES, HOVER

import analyzer

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def vehicle(tmp_path: Path) -> Path:
    path = tmp_path / "vehicle.toml"
    path.write_text('name = "hexa"\nescs = 6\n')
    return path


def test_the_old_name_of_a_vehicle_file_works_and_says_so(vehicle: Path) -> None:
    expected = analyzer.check(HOVER, vehicle=vehicle)
    with pytest.warns(DeprecationWarning, match="vehicle="):
        report = analyzer.check(HOVER, profile=vehicle)
    assert report == expected
    assert report.settings["profile"] == "hexa"


def test_both_names_at_once_are_refused(vehicle: Path) -> None:
    with pytest.warns(DeprecationWarning, match="vehicle="), pytest.raises(ValueError, match="vehicle and profile"):
        analyzer.check(HOVER, vehicle=vehicle, profile=vehicle)


def test_readings_that_were_asked_for_are_stated() -> None:
    assert analyzer.check(HOVER, dialects={20: ["dronecan"]}).settings["dialects"] == ["20=dronecan"]


def test_time_lines_are_there_if_they_are_asked_for() -> None:
    crash = CAPTURES / "propeller-lost.log"
    (plain,), (drawn,) = (analyzer.check(crash, drawn=drawn).triages for drawn in (False, True))
    assert (plain.timelines, plain) == ((), drawn)
    assert [lane for line in drawn.timelines for lane in line.lanes if lane.ch == 4]
