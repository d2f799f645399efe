"""Every error and warning once: the campaign in `campaign.py` with one flight for each rule."""

from __future__ import annotations

import pytest
from bench.campaign import Score, pages, rules, shows, table, tried
from kit.judged import outcome
from kit.simulated import flight


@pytest.mark.sampled(75)
@pytest.mark.parametrize("rule", rules())
def test_a_fault_is_found_where_the_key_says_and_nothing_else_is_wrong(rule: str, pytestconfig: pytest.Config) -> None:
    score = tried((rule, pytestconfig.getoption("--seed")))[1]
    assert score.missed == []
    assert score.errors == 0, score.wrong


def test_the_campaign_covers_every_layer_and_no_note() -> None:
    chosen = rules()
    assert {rule.partition("-")[0] for rule in chosen} == {"CAN", "TRF", "TYP", "PUSH", "BUS", "CAP"}
    assert {pages()[rule].severity for rule in chosen} == {"error", "warning"}
    assert len(chosen) > 100


def test_a_finding_elsewhere_is_no_recall() -> None:
    """The answer of another frame, long before: neither its frames nor its time fit."""
    key, run = next((key, run) for key, run in outcome(flight("TRF-010@1"), ("TRF-010",)).runs)
    assert key.rule == "TRF-010"
    frame, t = run.examples[0].frame + 1, run.first[0]
    assert shows(run, {"frames": [frame], "t_ns": 0, "t_end_ns": 0})
    assert shows(run, {"frames": [], "t_ns": t, "t_end_ns": t})
    assert not shows(run, {"frames": [1], "t_ns": t - 10**10, "t_end_ns": t - 10**10})


def test_shares_of_the_table() -> None:
    scores = {"TRF-010": Score(captures=4, found=3, false=1, errors=1), "BUS-001": Score(captures=4, found=4)}
    rows = [*table(scores, each=False)]
    assert rows[2:] == [
        "| TRF | 4 | 75.0% | 75.0% | 1 |", "| BUS | 4 | 100.0% | 100.0% | 0 |", "| all | 8 | 87.5% | 87.5% | 1 |",
    ]  # fmt: skip
