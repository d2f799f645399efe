"""The README's examples for other tools run as they stand there."""

from __future__ import annotations

import re
import shlex
import shutil
from typing import TYPE_CHECKING

import pytest
from command import CAPTURES, ROOT

from analyzer.cli import main

if TYPE_CHECKING:
    from pathlib import Path

SECTION = re.search(r"^## Other tools\n(.*?)^## ", (ROOT / "README.md").read_text(), re.DOTALL | re.MULTILINE)
assert SECTION is not None
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", SECTION[1], re.DOTALL | re.MULTILINE)
COMMANDS = [line for kind, text in BLOCKS if kind == "sh" for line in text.splitlines()]
PROGRAMS = [text for kind, text in BLOCKS if kind == "python"]


def test_there_are_examples() -> None:
    assert any("export" in line for line in COMMANDS)
    assert [tool for text in PROGRAMS for tool in ("duckdb", "pandas") if f"import {tool}" in text] == [
        "duckdb",
        "pandas",
    ]


@pytest.mark.parametrize("program", PROGRAMS)
def test_they_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], program: str
) -> None:
    shutil.copytree(CAPTURES, tmp_path / "captures")
    monkeypatch.chdir(tmp_path)
    for line in COMMANDS:
        name, *args = shlex.split(line, comments=True)
        assert name == "tailbyte"
        assert main(args) == 0
    capfd.readouterr()
    exec(program, {})
    assert capfd.readouterr().out.count("\n") > 4
