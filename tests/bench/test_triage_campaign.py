"""The campaign of verdicts: what it counts as right, and that it depends on nothing but its seeds."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
from bench import triage_campaign as campaign
from bench.triage_cases import Answer, Case, case, score

from analyzer.simulate.faults import catalogue

if TYPE_CHECKING:
    from pathlib import Path

FAMILIES = list(catalogue.stories())
STORY: dict[str, Any] = {
    "cause": {"kind": "wiring", "nodes": [13], "channels": [3]},
    "knowable": ["wiring", "esc", "unknown"],
    "first_event": {"t_ns": 10_000_000_000, "t_end_ns": 10_200_000_000},
}
HEALTHY: dict[str, Any] = {
    "cause": {"kind": "none", "nodes": [], "channels": []},
    "knowable": ["none"],
    "first_event": None,
}


@pytest.mark.parametrize(
    ("said", "outcome"),
    [
        (("wiring", [13], [3]), "right"),
        (("wiring", [], [3]), "right"),
        (("esc", [13], []), "right"),
        (("unknown", [], []), "right"),
        (("wiring", [], []), "wrong"),
        (("wiring", [12], []), "wrong"),
        (("esc", [], [3, 4]), "wrong"),
        (("control", [], []), "wrong"),
    ],
)
def test_a_verdict_is_right_by_kind_and_place(said: tuple[Any, ...], outcome: str) -> None:
    assert score(STORY, Answer.of(said)).outcome == outcome


def test_an_unknown_that_could_be_known_is_neither_right_nor_wrong() -> None:
    story = {**STORY, "knowable": ["wiring"]}
    assert score(story, Answer("unknown")).outcome == "unknown"
    healthy = score(HEALTHY, Answer("unknown"))
    assert (healthy.outcome, healthy.healthy_blamed) == ("unknown", False)


def test_a_healthy_flight_that_is_called_faulty_counts_apart() -> None:
    assert score(HEALTHY, Answer("esc", (11,), (1,))).healthy_blamed
    assert not score(HEALTHY, Answer("none")).healthy_blamed
    assert not score(STORY, Answer("control")).healthy_blamed


@pytest.mark.parametrize(
    ("times", "right"),
    [
        ((9_990_000_000, 10_020_000_000), True),
        ((10_190_000_000, 10_300_000_000), True),
        ((10_210_000_000, 10_300_000_000), False),
        ((9_000_000_000, 9_500_000_000), False),
        ((None, 10_100_000_000), True),
        ((), None),
    ],
)
def test_the_first_event_is_right_by_its_interval(times: tuple[Any, ...], right: bool | None) -> None:
    assert score(STORY, Answer.of(("wiring", [13], [3], *times))).first is right
    assert score(STORY, Answer.of(("esc", [13], [3], *times))).first is None


def test_every_family_has_its_turn_in_variants() -> None:
    cases = [case(seed, FAMILIES) for seed in range(len(FAMILIES) * 12)]
    assert {one.family for one in cases} == set(FAMILIES)
    assert cases == [case(seed, FAMILIES) for seed in range(len(FAMILIES) * 12)]
    seen = {name for one in cases for name in one.variants}
    assert {"tail", "twin", "distract", "mute", "stock", "late", "10 Hz", "50 Hz", "4 ESCs", "8 ESCs"} <= seen
    for one in cases:
        assert one.escs >= catalogue.scenario(one.family).least
        assert dict(one.options) == catalogue.story_options(one.scenario)


@pytest.mark.slow
def test_a_late_recording_begins_in_the_air_if_the_cause_comes_then() -> None:
    for family, cut in (("control-lost", True), ("heavy-lift", False)):
        late, whole = (
            Case(3, family, (("tail", False), ("distract", False)), 4, 30, stock=False, late=late).made()
            for late in (True, False)
        )
        assert late[1] == whole[1]
        assert whole[0].endswith(late[0])
        assert (len(late[0]) < 0.8 * len(whole[0])) == cut


def test_a_sample_goes_round() -> None:
    turns = [campaign.seeds(5, 100, 10, turn) for turn in range(10)]
    assert all(len(turn) == 10 for turn in turns)
    assert sorted(seed for turn in turns for seed in turn) == list(range(5, 105))
    assert campaign.seeds(5, 10, 0, 0) == list(range(5, 15))


@pytest.mark.parametrize(("outcome", "met"), [("unknown", True), ("wrong", False)])
def test_of_a_sample_nothing_may_be_wrong(outcome: str, *, met: bool) -> None:
    """One of eight is no share: an honest unknown is no failure, a wrong verdict is."""
    one = campaign.Judged(case(1, FAMILIES), STORY["cause"], STORY["knowable"], None, Answer("unknown"),
                          campaign.Score(outcome, first=None, healthy_blamed=False))  # fmt: skip
    assert campaign.report([one], each=False, sampled=True)[1] is met
    assert not campaign.report([one], each=False)[1]


def blind(path: Path) -> tuple[str, list[int], list[int]]:
    """Calls everything healthy. Nothing beside the capture tells the answer."""
    assert [one.name for one in path.parent.iterdir()] == ["crash.log"]
    return "none", [], []


def broken(path: Path) -> tuple[str, list[int], list[int]]:
    raise ValueError(path.name)


def campaigned(
    tmp_path: Path, judge: str, capsys: pytest.CaptureFixture[str], *more: str
) -> tuple[int, str, list[Any]]:
    cases = tmp_path / "cases.jsonl"
    status = campaign.main(
        ["--judge", f"{__name__}:{judge}", "--families", "gps-restart,bus-break", "--seeds", "4", "--cases",
         str(cases), *more]
    )  # fmt: skip
    return status, capsys.readouterr().out, [json.loads(line) for line in cases.read_text().splitlines()]


@pytest.mark.slow
def test_it_tells_what_was_said_beside_what_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, cases = campaigned(tmp_path, "blind", capsys)
    assert status == 1
    assert [(one["cause"]["kind"], one["answer"]["kind"]) for one in cases] == [("device", "none"), ("bus", "none")] * 2
    assert "wrong: none [] []; device []: --scenario gps-restart" in out
    assert "healthy called faulty: 0 of 0" in out
    assert campaigned(tmp_path, "blind", capsys) == (status, out, cases)


@pytest.mark.slow
def test_a_judge_that_fails_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, cases = campaigned(tmp_path, "broken", capsys)
    assert status == 1
    assert {one["score"]["outcome"] for one in cases} == {"wrong"}
    assert "ValueError('crash.log')" in out
