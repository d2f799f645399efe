"""bench/freeze.py: nothing differs from itself; a planted difference is seen, and where it begins."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from bench import freeze, frozen_outputs
from kit.command import HOVER

if TYPE_CHECKING:
    from pathlib import Path

CASES = "[!mo]*"  # all but `merged` and `once`


@pytest.fixture
def frozen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    captures, folder = tmp_path / "captures", tmp_path / "frozen"
    captures.mkdir()
    (captures / "short.log").write_bytes(b"".join(HOVER.read_bytes().splitlines(keepends=True)[:90]))
    monkeypatch.setattr(freeze, "CAPTURES", captures)
    monkeypatch.setattr(freeze, "flights", lambda: {"flight-00.log": "--flight hover --duration 0.2 --esc 1"})
    monkeypatch.setattr(freeze, "run_all", lambda todo, _workers: map(freeze.case, todo))
    monkeypatch.setattr(frozen_outputs, "ALL", ["decode {}", "export {} -o OUT/tables"])
    monkeypatch.setattr(frozen_outputs, "SOME", ["plot {} -o OUT/p.rrd", "check {} --from 5 --json OUT/r.json"])
    assert freeze.save(folder, 1, CASES) == 0
    return folder


def compared(folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    return freeze.compare(folder, 1, CASES), capsys.readouterr().out


@pytest.mark.slow
def test_nothing_differs_from_itself(frozen: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert compared(frozen, capsys) == (0, "2 cases, 0 outputs differ\n")


@pytest.mark.slow
def test_another_capture_is_seen_in_every_output(frozen: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capture = frozen / "inputs" / "short.log"
    capture.write_text("".join(capture.read_text().splitlines(keepends=True)[:-1]))
    status, text = compared(frozen, capsys)
    assert status == 1
    for line in ("decode short.log", "export short.log -o OUT/tables > OUT/tables/frames.parquet", "plot short.log"):
        assert f"short.log: {line}" in text
    assert "  -90 rows [" in text
    assert "flight-00.log: " not in text


@pytest.mark.slow
def test_another_flight_is_seen(frozen: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = {"flight-00.log": "--flight hover --duration 0.2 --esc 1 --seed 5"}
    (frozen / "flights.json").write_text(json.dumps(other))
    status, text = compared(frozen, capsys)
    assert status == 1
    assert "  only after\n" in text  # the line of another seed
    assert "decode flight-00.log" not in text  # what is read is the frozen file


def test_the_first_lines_that_differ_are_shown() -> None:
    text = freeze.head("".join(f"{k}\n" for k in range(90)), "".join(f"{k % 70}\n" for k in range(90)))
    assert text.startswith("  line 71\n")
    assert "  -70\n" in text
    assert "  +0\n" in text
    assert len(text.splitlines()) <= freeze.HEAD + 1


def test_an_option_has_its_old_or_its_new_name(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("--vehicle", "--flight"):
        for text, expected in ((f"... {name} X", name), ("... --profile X", "--profile")):
            monkeypatch.setattr(frozen_outputs, "_HELP", {})
            monkeypatch.setattr(frozen_outputs, "run", lambda _, text=text: (0, text, ""))
            assert frozen_outputs.option(name) == expected
