"""The report of a fleet that was made with a key finds what the key says, and nothing else."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from bench.make_fleet import make

from analyzer.app.version import version
from analyzer.fleet.cluster import Serial
from analyzer.fleet.driver import FleetRun, jobs_of
from analyzer.fleet.jobs import FleetSettings, Retries
from analyzer.fleet.listing import Provenance, listed
from analyzer.fleet.report import page, text
from analyzer.fleet.report.build import build
from analyzer.fleet.store import ResultStore
from analyzer.fleet.tables import TABLES, rows_table

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    key = make(folder / "logs")
    store, settings = ResultStore(str(folder / "results")), FleetSettings()
    names = Provenance("{vehicle}/{date}/*.log.gz")
    jobs = jobs_of(listed([str(folder / "logs/**/*.log.gz")], store.place), names, settings.digest())
    for name in key["vanishing"]:
        (folder / "logs" / name).unlink()
    FleetRun(store, settings, Retries(2, 0.01)).over(jobs, Serial())
    return store, key


@pytest.fixture(scope="module")
def report(fleet):
    return build(fleet[0], "2026-10-15", 20)


def test_what_there_is(report, fleet):
    head, key = report.head, fleet[1]
    assert (head.captures, head.vehicles, head.duplicates) == (key["captures"], key["vehicles"], key["duplicates"])
    assert (head.unreadable, head.damaged, head.unavailable) == (
        key["unreadable"],
        key["damaged"],
        len(key["vanishing"]),
    )


def test_odd_escs(report, fleet):
    found = [(one.vehicle, one.ch, one.quantity, 1 if one.difference > one.fleet else -1) for one in report.odd]
    assert found == [(one["vehicle"], one["ch"], one["quantity"], one["sign"]) for one in fleet[1]["odd"]]
    (since,) = [one.since for one in report.odd]
    assert abs(int(since[-2:]) - int(fleet[1]["odd"][0]["since"][-2:])) <= 3
    assert report.tested == 3 * 4 * fleet[1]["vehicles"]


def test_firmware(report, fleet):
    found = [one for one in report.rates if one.differs]
    assert [(one.rule, one.software[:3]) for one in found] == [
        (one["rule"], one["software"]) for one in fleet[1]["firmware"]
    ]
    assert [(one.separable, list(one.only_on)) for one in found] == [(False, fleet[1]["not_separable"])]
    assert all(one.low <= one.rate <= one.high for one in report.rates)


def test_captures_to_open(report, fleet):
    assert [{"vehicle": one.vehicle, "kind": one.kind} for one in report.open_first] == fleet[1]["open"]


def test_nothing_got_worse(report):
    assert report.since is not None
    assert report.since.worse == ()
    assert report.since.seen["TRF-003"] in (1.5, 2.0, 3.0)


@pytest.mark.parametrize("width", [80, 200])
def test_the_screen_fits_and_begins_with_the_answer(report, width):
    shown = text.render(report, width=width)
    assert max(len(line) for line in shown.splitlines() if "/logs/" not in line) <= width
    assert "judged captures fail, of 3 vehicles (v0" in " ".join(shown.split("\n\n")[0].split())
    shown = " ".join(shown.split("\n\n")[0].split()) + shown
    words = ["Open these first", "v03       2 temperature", "TRF-003", "not separable", "nothing", "Duplicates 1"]
    for word in (*words, "1 odd ESC: v03 ch2", "more often with firmware 2.5"):
        assert word in shown, word


@pytest.mark.parametrize("by", ["vehicle", "software", "rule", "esc"])
def test_one_table_alone(report, by):
    assert len(text.render(report, by=by).splitlines()) > 4


def test_for_programs_and_browsers(report, fleet, command, tmp_path):
    place = fleet[0].place
    status, shown, said = command(
        "fleet", "report", place, "--html", tmp_path / "fleet.html", "--json", tmp_path / "fleet.json"
    )
    assert (status, said, shown[:5]) == (0, "", "Fleet")
    assert json.loads((tmp_path / "fleet.json").read_text())["head"]["captures"] == report.head.captures
    html = (tmp_path / "fleet.html").read_text()
    assert html.count("<svg") == len(report.odd) == 1
    assert f"tailbyte {version()}, rules {FleetSettings().digest()}" in html
    assert "http" not in html.replace("http-equiv", "")
    assert page.render(report).startswith("<!doctype html>")


def test_names_that_others_chose_are_text_and_no_more(report):
    evil = "<script>alert(1)</script>\x1b[31m\u202e&\"'" + "long" * 20
    vehicles = tuple(replace(one, vehicle=evil) for one in report.vehicles)
    found = replace(report, vehicles=vehicles, odd=tuple(replace(one, vehicle=evil) for one in report.odd))
    html = page.render(found)
    assert [word for word in ("<script", "\x1b", "\u202e", '&"') if word in html] == []
    for by in (None, "esc", "vehicle"):
        shown = text.render(found, by=by)
        assert "\x1b" not in shown
        assert by is not None or max(len(line) for line in shown.splitlines() if "/logs/" not in line) <= 80


def test_a_fleet_of_which_nothing_is_known(tmp_path):
    store = ResultStore(str(tmp_path / "results"))
    store.append({"runs": [rows_table("runs", [{**dict.fromkeys(TABLES["runs"].names), "key": "", "run": "1"}])]})
    found = build(store, "7d", 20)
    assert "0 of 0 judged captures fail" in " ".join(text.render(found).split())
    assert "<p>None.</p>" in page.render(found)


def test_a_long_table_is_folded(report):
    many = tuple(replace(report.vehicles[0], vehicle=f"v{number:03}") for number in range(500))
    html = page.render(replace(report, vehicles=many))
    assert html.count("<details>") == 1
    assert "and 450 more" in html
    assert "v499" in html
