"""The README's examples for other tools and of simulated traffic run as they stand there."""

from __future__ import annotations

import re
import shlex
import shutil
import time
from dataclasses import asdict
from typing import TYPE_CHECKING

import pytest
from command import CAPTURES, ROOT
from judged import registry

from analyzer.cli import main
from analyzer.rules.catalogue import load as pages
from analyzer.rules.expected import load

if TYPE_CHECKING:
    from pathlib import Path


def section(name: str) -> tuple[list[str], list[str]]:
    """The commands and the programs in it."""
    found = re.search(rf"^## {name}\n(.*?)^## ", (ROOT / "README.md").read_text(), re.DOTALL | re.MULTILINE)
    assert found is not None
    blocks = re.findall(r"^```(\w+)\n(.*?)^```$", found[1], re.DOTALL | re.MULTILINE)
    commands = [line for kind, text in blocks if kind == "sh" for line in text.splitlines()]
    return commands, [text for kind, text in blocks if kind == "python"]


COMMANDS, PROGRAMS = section("Other tools")


def test_there_are_examples() -> None:
    assert any("export" in line for line in COMMANDS)
    assert [tool for text in PROGRAMS for tool in ("duckdb", "pandas") if f"import {tool}" in text] == [
        "duckdb",
        "pandas",
    ]


def obey(commands: list[str]) -> None:
    for line in commands:
        name, *args = shlex.split(line, comments=True)
        assert name == "tailbyte"
        assert main(args) == 0


@pytest.mark.parametrize("program", PROGRAMS)
def test_they_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], program: str
) -> None:
    shutil.copytree(CAPTURES, tmp_path / "captures")
    monkeypatch.chdir(tmp_path)
    obey(COMMANDS)
    capfd.readouterr()
    exec(program, {})
    assert capfd.readouterr().out.count("\n") > 4


def test_simulated_traffic(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    commands, (program,) = section("Traffic with known faults")
    obey(commands)
    capfd.readouterr()
    exec(program, {})
    shown = capfd.readouterr().out.splitlines()
    assert [line.split()[0] for line in shown[::2]] == ["TRF-003", "TYP-305"]
    assert all(line.startswith("    (17734753") for line in shown[1::2])


def test_the_vehicle_file_is_one_and_shows_every_key(tmp_path: Path) -> None:
    found = re.search(
        r"^### Vehicle files\n.*?^```toml\n(.*?)^```$", (ROOT / "README.md").read_text(), re.DOTALL | re.MULTILINE
    )
    assert found is not None
    path = tmp_path / "vehicle.toml"
    path.write_text(found[1])
    vehicle = load(path, pages(registry()), registry())
    parts = [asdict(vehicle), asdict(vehicle.nodes[11]), asdict(vehicle.excuses[0]), asdict(vehicle.demand)]
    assert all(value not in (None, "", (), {}) for part in parts for value in part.values())


SHOWN = re.findall(
    r"^```console\n\$ tailbyte ([^\n]*)\n(.*?)^```$", (ROOT / "README.md").read_text(), re.DOTALL | re.MULTILINE
)


@pytest.mark.parametrize(("line", "shown"), SHOWN)
def test_what_is_shown_is_what_is_printed(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], line: str, shown: str
) -> None:
    """Dots stand for what is left out: lines, if they are one, else part of a line."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    main(shlex.split(line))
    wanted = re.sub(r"^\\.\\.\\.\\\n", r"(?:.*\n)*?", re.escape(shown), flags=re.MULTILINE).replace(r"\.\.\.", ".*")
    assert re.match(wanted, capfd.readouterr().out), shown


def test_there_is_output_to_compare() -> None:
    assert {line.split()[0] for line, _ in SHOWN} >= {"check"}
