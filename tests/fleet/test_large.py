"""Questions about hundreds of vehicles: what was put in is found, and nothing of what is chance or one vehicle's."""

from __future__ import annotations

from dataclasses import replace

import pytest
from kit.fleet_rows import Made

from analyzer.fleet.report import page, text
from analyzer.fleet.report.build import build
from analyzer.fleet.report.model import OpenFirst
from analyzer.fleet.store import ResultStore
from analyzer.fleet.tables import rows_table
from analyzer.views.terminal import display_width

FIRMWARE = {"vehicles": 40, "escs": 2, "firmware": lambda vehicle: "2.5" if vehicle % 4 == 0 else "2.7"}
MIDDLE = "2026-09-13"  # the twelfth day


def report_of(place, **made):
    store = ResultStore(str(place / "results"))
    Made(**made).into(store)
    return build(store, MIDDLE, 20)


def put_in(quantity, vehicle, esc, day):
    """Return what differs: one ESC ages, one draws more current from a day on, one turned faster ever since."""
    late = max(day - 11, 0)
    return {
        ("temperature_median", 17, 4): 9.0 * late / 12,
        ("current_per_krpm2", 120, 0): 0.12 if late else 0.0,
        ("rpm_per_percent", 200, 7): 0.06,
    }.get((quantity, vehicle, esc), 0.0)


@pytest.mark.slow
def test_three_of_two_thousand_escs(tmp_path):
    report = report_of(tmp_path, vehicles=250, other=put_in)
    found = {(one.vehicle, one.ch, one.quantity, one.against) for one in report.odd}
    assert found == {
        ("v017", 5, "temperature_median", "own past"),
        ("v120", 1, "current_per_krpm2", "own past"),
        ("v200", 8, "rpm_per_percent", "same firmware"),
    }
    assert {one.vehicle: one.since[:8] for one in report.odd} == {"v017": "2026-09-", "v120": "2026-09-", "v200": ""}
    assert report.tested == 3 * 8 * 250


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3])
def test_none_of_two_thousand_escs(tmp_path, seed):
    assert report_of(tmp_path, vehicles=250, days=20, seed=seed).odd == ()


def test_a_few_odd_flights_at_the_end_are_no_change(tmp_path):
    def late(quantity, vehicle, esc, day):
        return 20.0 if quantity == "temperature_median" and (vehicle, esc) == (3, 4) and day >= 22 else 0.0

    assert report_of(tmp_path, vehicles=10, other=late).odd == ()


def test_a_firmware_that_breaks_a_rule_on_all_its_vehicles(tmp_path):
    report = report_of(tmp_path, **FIRMWARE, broken=lambda vehicle, _: 0.02 if vehicle % 4 else 0.3)
    assert [(one.software, one.separable) for one in report.rates if one.differs] == [("2.5", False)]


def test_a_rule_that_one_vehicle_breaks_says_nothing_of_its_firmware(tmp_path):
    report = report_of(tmp_path, **FIRMWARE, broken=lambda vehicle, _: 0.9 if vehicle == 8 else 0.02)
    (rate,) = [one for one in report.rates if one.software == "2.5"]
    assert rate.captures >= 20
    assert not [one for one in report.rates if one.differs]
    assert rate.high > 2 * rate.rate  # as wide as vehicles differ
    assert "of v008" in text.render(report)


def test_worse_is_what_gets_worse_on_vehicles_that_flew_before(tmp_path):
    report = report_of(tmp_path, vehicles=40, escs=2, broken=lambda _, day: 0.2 if day >= 12 else 0.05)
    assert [one.rule for one in report.since.worse] == ["TRF-003"]


def test_a_new_vehicle_that_was_always_bad_is_not_worse(tmp_path):
    report = report_of(
        tmp_path, vehicles=40, escs=2, flies=lambda vehicle, day: vehicle != 8 or day >= 12,
        broken=lambda vehicle, _: 0.9 if vehicle == 8 else 0.02,
    )  # fmt: skip
    assert report.since.worse == ()
    assert report.since.vehicles == 39


@pytest.mark.parametrize("least", [1, 6])
def test_too_few_flights_to_tell_now_from_then_are_refused(least, tmp_path):
    store = ResultStore(str(tmp_path / "results"))
    Made(vehicles=2, escs=4, days=2).into(store)
    with pytest.raises(ValueError, match=rf"--flights {least}: at least 7"):
        build(store, None, least)


def test_seven_flights_tell_how_an_esc_was(tmp_path):
    store = ResultStore(str(tmp_path / "results"))
    warm = ("temperature_median", 1, 2)
    Made(vehicles=4, days=7, other=lambda *esc: 20 * (esc[:3] == warm and esc[3] > 1)).into(store)
    (one,) = build(store, None, 7).odd
    assert (one.vehicle, one.ch, one.against, one.since) == ("v001", 3, "own past", "2026-09-03")


def test_what_is_not_compared_is_told(tmp_path):
    def firmware(vehicle):
        return "2.5" if vehicle == 0 else "2.7"

    few = report_of(tmp_path / "few", vehicles=2, escs=2, days=6, firmware=firmware, broken=lambda *_: 1.0)
    some = report_of(tmp_path / "some", vehicles=4, escs=2, days=6, firmware=firmware, broken=lambda *_: 1.0)
    for shown in (text.render(few), page.render(few)):
        assert "othing is compared: no firmware has 10 flights" in shown
        assert "annot tell: no flight after it" in shown
        assert "breaks a rule" not in shown
    assert "2.5: 6 flights (fewer than 10: not compared)" in text.render(some)
    assert "2.7: 18 flights, 18 flight hours" in text.render(some)


@pytest.mark.parametrize("width", [80, 200])
@pytest.mark.parametrize("name", ["機体" * 20, "x" * 70])
def test_long_and_wide_names_leave_the_screen_as_wide_as_it_is(width, name, tmp_path):
    def firmware(vehicle):
        return name if vehicle < 2 else f"2.7{name}"

    def warm(quantity, vehicle, esc, day):
        return 9.0 if (quantity, vehicle, esc) == ("temperature_median", 3, 2) and day > 14 else 0.0

    def broken(vehicle, day):
        return 0.6 if vehicle < 2 or day > 11 else 0.05

    report = report_of(tmp_path, vehicles=8, firmware=firmware, broken=broken, other=warm)
    odd = tuple(replace(one, vehicle=name) for one in report.odd)
    rules = tuple(replace(one, title=f"{name} {name}", most=name, of_most=50) for one in report.rules)
    vehicles = tuple(replace(one, vehicle=name, failed=1) for one in report.vehicles)
    open_first = (OpenFirst(name, "2026-09-01", f"{name} stopped", "device", "likely", None, "/l", f"tailbyte {name}"),)
    found = replace(report, odd=odd, rules=rules, vehicles=vehicles, open_first=open_first)
    lines = text.render(replace(found, head=replace(found.head, store=f"/{name}")), width=width).splitlines()
    assert [line for line in lines if display_width(line) > width and "tailbyte" not in line] == []
    assert name in "".join(line.strip() for line in lines)


def test_an_esc_on_two_buses_flies_once(tmp_path):
    made = Made(vehicles=4, escs=4, days=12, other=put_in)
    made.into(ResultStore(str(tmp_path / "one")))
    for name in ("nodes", "esc_health"):
        made.rows[name] += [{**row, "bus": "can1"} for row in made.rows[name]]
    store = ResultStore(str(tmp_path / "two"))
    store.append({name: [rows_table(name, rows)] for name, rows in made.rows.items()})
    assert build(store, None, 20).tested == 0
    assert build(store, None, 12).tested == 4 * 4 * 3
