"""What broke first in HTML: the first section of the report, and a page of its own."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES
from kit import html_samples as samples
from kit.triaged import of
from report.test_html import Page

from analyzer.cli import main
from analyzer.report.html.triage import ROWS
from analyzer.report.triage.html import render
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from analyzer.flight.verdict.model import Triage

CRASH = CAPTURES / "propeller-lost.log"


@pytest.fixture(scope="module")
def crash() -> Page:
    return Page(render(of("propeller-lost.log")))


def test_it_says_what_the_screen_says(crash: Page) -> None:
    found = of("propeller-lost.log")
    one = found.first
    said = [one.title, one.support, *one.reasons, "nothing found", *found.not_seen, *found.commands]
    said += [f"{excluded.fact}: {excluded.seen}" for excluded in found.excluded]
    said += ["08:02:13.293 to 08:02:13.560", "commands are 85 % apart", "tailbyte explain propulsion"]
    assert [text for text in said if text not in crash.text] == []


def test_each_channel_is_a_lane_and_each_event_a_mark_that_leads_to_its_row(crash: Page) -> None:
    labels = [of_svg["aria-label"] or "" for of_svg in crash.all("svg") if of_svg.get("class") == "course-lane"]
    channels = [re.sub(r", \d+ events?$", "", label) for label in labels if label.startswith("ch")]
    assert channels == ["ch1 node 11", "ch2 node 12, reverse", "ch3 node 13", "ch4 node 14, reverse"]
    assert [label.partition(",")[0] for label in labels[:3]] == ["flights", "commands (node 10)", "supply"]
    ids = {one["id"] for _, one in crash.tags if "id" in one}
    marks = [(one["href"] or "")[1:] for one in crash.all("a") if "-event-" in (one["href"] or "")]
    assert len(marks) > 2
    assert set(marks) <= ids
    assert len([one for one in ids if one and "-event-" in one]) == len(of("propeller-lost.log").events)
    titles = re.findall(r"<title>(.*?)</title>", render(of("propeller-lost.log")), re.DOTALL)
    assert any("ch4 motor: speed +6 %, current -98 %" in title for title in titles)


def test_modes_are_bands_with_their_names(crash: Page) -> None:
    styles = [one["class"] or "" for one in crash.all("rect") if "stay" in (one.get("class") or "")]
    assert len(styles) == 16
    assert len(set(styles)) == 4
    assert crash.text.count("operating") > 4
    failed = render(of("esc-failure.mcap"))
    assert 'class="stay failed"' in failed


def test_nothing_comes_from_elsewhere_and_nothing_acts(crash: Page) -> None:
    assert not crash.all("script")
    assert not crash.all("link")
    assert not crash.all("img")
    assert not [one for _, one in crash.tags if "style" in one or any(name.startswith("on") for name in one)]
    policy = next(one["content"] for one in crash.all("meta") if one.get("http-equiv") == "Content-Security-Policy")
    assert policy is not None
    assert policy.startswith("default-src 'none'; style-src 'sha256-")


@pytest.mark.parametrize("text", samples.HOSTILE, ids=range(len(samples.HOSTILE)))
def test_hostile_texts_are_harmless(text: str) -> None:
    found = _saying(of("esc-failure.mcap"), text)
    page = Page(render(found))
    usual = Page(render(_saying(of("esc-failure.mcap"), "plain")))
    assert [name for name, _ in page.tags if name != "text"] == [name for name, _ in usual.tags if name != "text"]
    assert not [c for c in render(found) if not c.isprintable() and c != "\n"]


def _saying(found: Triage, text: str) -> Triage:
    """The answer with a text from a capture wherever there can be one: only modes, whose room decides, keep theirs."""
    for one in (found.first, *found.verdicts):
        found = replace(
            found, verdicts=[replace(one, title=text, reasons=[text], against=[text], notes=[(text, text)])]
        )
    for event in found.events:
        event.text = text
    return replace(found, captures=[text], lines=[(text, text)], commands=[text], not_seen=[text])


def test_tables_are_bounded() -> None:
    found = of("control-lost.log")
    many = replace(found, events=[*found.events, *(replace(found.events[0]) for _ in range(3 * ROWS))])
    page = Page(render(many))
    assert len([one for one in page.all("tr") if one.get("id")]) == ROWS
    assert f"{len(many.events) - ROWS:,} more events are not listed" in page.text
    marked = {one["href"] for one in page.all("a") if "-event-" in (one["href"] or "")}
    assert {one[1:] for one in marked if one} <= {one["id"] for _, one in page.tags if "id" in one}


def test_without_a_flight_it_says_so() -> None:
    page = Page(render(of("startup.log")))
    assert "not judged: 353 reports of 4 ESCs, motors stopped" in page.text
    assert not page.all("figure")


def test_the_report_of_check_begins_with_it(tmp_path: Path, command: Callable[..., tuple[int, str, str]]) -> None:
    path = tmp_path / "report.html"
    assert command("check", CRASH, "--html", path)[0] == 0
    page = Page(path.read_text("utf-8"))
    sections = [one["id"] for one in page.all("section")]
    assert sections[:2] == ["triage", "summary"]
    assert "ESC ch4 (node 14): lost the load of its motor" in page.text
    alone = Page(render(of("propeller-lost.log")))
    assert len(_speeds(alone)) == 4
    assert _speeds(page) == _speeds(alone)


def _speeds(page: Page) -> list[str]:
    return [one["d"] or "" for one in page.all("path") if one["class"] == "strand speed"]


@pytest.mark.slow
def test_several_captures_have_a_section_each(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    main(["check", str(CRASH), str(CAPTURES / "control-lost.log"), "--html", str(path), "-o", str(tmp_path / "x.json")])
    page = Page(path.read_text("utf-8"))
    assert "lost the load of its motor" in page.text
    assert "control was lost first" in page.text
    ids = [one["id"] for _, one in page.tags if "id" in one]
    assert len(ids) == len(set(ids))
    assert "triages" not in (tmp_path / "x.json").read_text()


def test_a_report_of_what_cannot_be_opened_has_no_verdict(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "report.html"
    assert main(["check", str(tmp_path / "none.log"), "--html", str(path)]) == 3
    assert 'id="triage"' not in path.read_text()
    assert main(["triage", str(tmp_path / "none.log"), "--html", str(tmp_path / "triage.html")]) == 3
    assert not (tmp_path / "triage.html").exists()
    assert "Traceback" not in capfd.readouterr().err


def test_motors_that_stop_where_something_broke_are_no_landing() -> None:
    """The table of flights and the drawn time line say of it what the screen says."""
    page = render(of("zero-in-air.log"))
    assert "landed" not in page
    assert "flight 1, motors stopped" in page
    well = replace(of("zero-in-air.log"), verdicts=[replace(of("zero-in-air.log").first, kind="none", support="")])
    calm = render(replace(well, after=(), primary=()))
    assert "flight 1, landed" in calm
    assert "motors stopped" not in calm
