"""A NaN that signals, as a sender may make one, is a value that is none: nothing warns of it."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import pytest
from kit.encode import Code, log_line, transfer

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

T0 = 1773475330 * 10**9
FILTER = (
    "ESCStatus.voltage * 2 > 1 || -ESCStatus.voltage > 3 || abs(ESCStatus.voltage) > 70 || max(ESCStatus.voltage) > 3"
    " || lag(ESCStatus.voltage, 1 s) > 3 || within(ESCStatus.voltage, 3 V, 1 %) || ESCStatus.voltage in {1..2}"
)
RULE = "[rule.OWN-001]\ntitle = 'x'\nwhen = 'ESCStatus.voltage - lag(ESCStatus.voltage, 200 ms) > 1'\n"


@pytest.fixture
def signals(tmp_path: Path) -> Path:
    path = tmp_path / "nan.log"
    rest = {"error_count": 0, "current": 1.0, "temperature": 300.0, "rpm": 900, "power_rating_pct": 9, "esc_index": 0}
    path.write_text("".join(
        log_line(frame) + "\n"
        for k in range(30)
        for frame in transfer("ESCStatus", rest | {"voltage": Code(0x7C01)}, 11, k).frames(T0 + k * 10**8)
    ))  # fmt: skip
    return path


@pytest.mark.parametrize("args", [
    ("decode", "-Y", FILTER), ("check",), ("events",), ("triage",), ("info",), ("stats", "values,ESCStatus.voltage"),
    ("stats", "io,1,MAX(ESCStatus.voltage*2)"), ("stats", "odd"), ("diff", "SAME"), ("check", "--vehicle", "OWN"),
])  # fmt: skip
def test_nothing_warns(command: Command, signals: Path, tmp_path: Path, args: tuple[str, ...]) -> None:
    own = tmp_path / "own.toml"
    own.write_text(RULE)
    names = {"SAME": signals, "OWN": own}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _, _, err = command(*(names.get(one, one) for one in args), signals)
    assert "Warning" not in err
