"""Golden pairs: each capture beside what the command shows of it.

`pytest tests/test_golden.py --regenerate` writes the `.expected` files anew; read the difference before you commit it.
The values themselves are checked against the senders in test_captures.py, what the keys say in test_sample_flights.py.
"""

from __future__ import annotations

import json
import time
from typing import TYPE_CHECKING

import pytest
from kit.command import CAPTURES
from kit.simulated import FLIGHTS, key_of

from analyzer.cli import main

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

CASES = sorted(path for path in CAPTURES.iterdir() if path.suffix in {".log", ".txt", ".mcap"})


def shown(case: Path, capsys: pytest.CaptureFixture[str]) -> Iterator[str]:
    """The list in ISO time, the complaints, the account, and the exit status; of a flight the places of its faults."""
    if case.name not in FLIGHTS:
        yield from run(case, capsys, "decode", "-t", "ud")
        return
    yield from run(case, capsys, "info", "--all", "--types")
    for fault in json.loads(key_of(case).read_text())["faults"]:
        yield f"\n{fault['rule']}: {fault['done']}\n"
        where = f"{fault['frames'][0]}+-2ms" if fault["frames"] else f"{fault['time']}+-2ms"
        yield from run(case, capsys, "decode", "--around", where)


def run(case: Path, capsys: pytest.CaptureFixture[str], *command: str) -> Iterator[str]:
    status = main([*command, case.name])
    got = capsys.readouterr()
    yield got.out
    yield got.err
    yield f"exit {status}\n"


@pytest.fixture(autouse=True)
def _anywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """`info` shows local times and the name of the file."""
    monkeypatch.chdir(CAPTURES)
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()


@pytest.mark.sampled(6)
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_expected(case: Path, capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest) -> None:
    text = "".join(shown(case, capsys))
    expected = case.with_suffix(".expected")
    if request.config.getoption("--regenerate"):
        expected.write_text(text, encoding="utf-8")
    assert text == expected.read_text(encoding="utf-8")


def test_every_capture_has_its_pair() -> None:
    assert {case.stem for case in CASES} == {path.stem for path in CAPTURES.glob("*.expected")}
    assert len(CASES) >= 15
