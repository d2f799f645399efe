"""What a rule finds does not depend on how the capture comes: row by row, by seven, by 4,096, or whole."""

from __future__ import annotations

import pytest
from bench.campaign import BIT_RATE, flown
from kit.judged import outcome

from analyzer.simulate.faults import catalogue

# BUS-003 takes a bus that is full for seconds: tests/dissectors/tmotor/test_rates.py has some, in batches, too.
RULES = [rule for rule in catalogue.faults() if rule != "BUS-003"]
AROUND = 600  # lines before and behind the fault, for what comes row by row


@pytest.mark.sampled(400)
@pytest.mark.parametrize("rule", RULES)
def test_a_rule_finds_the_same_however_the_capture_comes(rule: str, pytestconfig: pytest.Config) -> None:
    text, answer, _ = flown(rule, pytestconfig.getoption("--seed"))
    found = outcome(text, (rule,), bit_rate=BIT_RATE).runs
    assert found
    assert outcome(text, (rule,), 4096, bit_rate=BIT_RATE).runs == found
    at = min(answer["frames"], default=AROUND)
    piece = "".join(text.splitlines(keepends=True)[max(at - AROUND, 0) : at + AROUND])
    around = outcome(piece, (rule,), bit_rate=BIT_RATE).runs
    assert outcome(piece, (rule,), 7, bit_rate=BIT_RATE).runs == around
    assert outcome(piece, (rule,), 1, bit_rate=BIT_RATE).runs == around
