"""Columns of `stats io` know what `-Y` knows: findings, labels, words that exist nowhere."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

FAULTY = CAPTURES / "mission-8-faults.log"


@pytest.mark.parametrize(
    "text", ["finding.rule", 'finding.severity == "error"', 'finding.rule == "TRF-003" && src == 12']
)
def test_a_column_counts_what_a_list_of_frames_has(command: Command, text: str) -> None:
    _, out, _ = command("decode", FAULTY, "--frame-list", "-T", "jsonl", "-Y", text)
    frames = sum(json.loads(line)["number"] is not None for line in out.splitlines())
    assert frames
    for more in ((), ("-Y", text)):
        _, out, _ = command("stats", f"io,0,{text}", FAULTY, "-T", "json", *more)
        assert json.loads(out)["statistics"]["io"]["total"][text] == frames


def test_a_column_knows_the_vehicle_file(command: Command, tmp_path: Path) -> None:
    text = 'node.label == "front left"'
    status, out, err = command("stats", f"io,0,{text}", FAULTY)
    assert (status, out) == (2, "")
    assert "give one with --vehicle" in err
    vehicle = tmp_path / "vehicle.toml"
    vehicle.write_text('[node.12]\nlabel = "front left"\n')
    _, out, _ = command("stats", f"io,0,{text},node == 12", FAULTY, "-T", "json", "--vehicle", vehicle)
    total = json.loads(out)["statistics"]["io"]["total"]
    assert total[text] == total["node == 12"] > 0


def test_a_rule_that_nobody_knows(command: Command) -> None:
    status, out, err = command("stats", 'io,1,finding.rule == "TRF-3"', FAULTY)
    assert (status, out) == (2, "")
    assert "no rule is called 'TRF-3'; did you mean TRF-003?" in err
