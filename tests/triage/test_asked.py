"""`analyzer.triage`: what it takes, and what its screen says of the clock and of what to do next."""

from __future__ import annotations

from pathlib import Path

import pytest
from kit import CAPTURES

import analyzer
from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.app.triage import RunTriage
from analyzer.report.triage.text import render
from analyzer.sources.merge import open_captures
from analyzer.sources.origin import given

LOST = CAPTURES / "propeller-lost.log"


def test_an_opened_capture_is_judged_as_its_file_is() -> None:
    opened = analyzer.open_capture(LOST)
    assert analyzer.triage(opened).first == analyzer.triage(LOST).first
    with LOST.open("rb") as file:
        assert analyzer.triage(analyzer.open_capture(file)).first == analyzer.triage(LOST).first


@pytest.mark.parametrize("more", [{"same_bus": True}, {"dissectors_": [Path("acme")]}, {"dialects": {14: ["tm"]}}])
def test_an_opened_capture_has_been_told_how_to_read_it(more: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="has been told how to read it"):
        analyzer.triage(analyzer.open_capture(LOST), **more)  # type: ignore[arg-type]


def test_what_a_filter_selects_is_not_judged() -> None:
    with pytest.raises(ValueError, match="what a filter selects of a capture cannot be judged"):
        analyzer.triage(analyzer.open_capture(LOST, filter="ESCStatus"))


def test_a_log_that_is_none_is_an_error(tmp_path: Path) -> None:
    wrong = tmp_path / "flight.bin"
    wrong.write_bytes(b"no log")
    with pytest.raises(analyzer.CaptureError):
        analyzer.triage(LOST, log=wrong)


@pytest.mark.parametrize(("utc", "zone"), [(True, "UTC"), (False, "local")])
def test_the_head_says_whose_time_it_is(utc: bool, zone: str) -> None:
    head = render(analyzer.triage(LOST), utc=utc).splitlines()[0]
    assert f" {zone}  can0  1 flight, cut" in head
    assert len(head) <= 80


def test_the_plot_to_look_at_is_around_the_moment() -> None:
    found = analyzer.triage(LOST)
    assert found.commands[2] == f"tailbyte plot {LOST} --around {found.first.frame + 1}+-5s"


def test_no_command_reads_a_bus_again(monkeypatch: pytest.MonkeyPatch) -> None:
    run = Run(Request(("can0",)), source=open_captures((given(LOST),)))
    monkeypatch.setattr(type(run.source), "live", property(lambda _: True, lambda *_: None))
    looked = RunTriage(run)
    for _ in looked.over(run.inside()):
        pass
    found = looked.found()
    assert found.first.told
    assert found.commands == ()
    assert "Next" not in render(found)
