"""Help on a screen, its examples, and what the command says when it is called alone."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from kit.command import LIMIT, environment

from analyzer.cli.commands import COMMANDS, parser
from analyzer.cli.usage import first_steps, here
from analyzer.cli.usage.examples import EXAMPLES, FIRST
from analyzer.sources.formats import FORMATS

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]


@pytest.mark.parametrize("columns", [40, 80, 200])
@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_help_fits_the_screen(command: Command, monkeypatch: pytest.MonkeyPatch, name: str, columns: int) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    status, out, err = command(*([name] if name else []), "--help")
    assert (status, err) == (0, "")
    lines = out.splitlines()
    if columns == 80:
        assert [line for line in lines if len(line) > 80] == []
    assert max(len(line) for line in lines if not line.startswith("  ")) <= max(columns, 80)
    examples = lines[lines.index("examples:") + 1 :]
    shown = "\n".join(examples)
    assert all(line in shown and about in shown for line, about in EXAMPLES[name])


def test_every_command_has_examples() -> None:
    assert set(EXAMPLES) == {"", *COMMANDS}
    for name, lines in EXAMPLES.items():
        assert len(lines) >= 3, name
        for line, _ in lines:
            assert re.search(rf"\btailbyte {name}\b", line), line


def test_the_end_of_a_help_is_not_wrapped_anew_where_its_lines_are_meant(command: Command) -> None:
    out = command("completion", "--help")[1]
    assert "\n  tailbyte completion fish > ~/.config/fish/completions/tailbyte.fish\n" in out


def test_alone_it_shows_five_commands(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(first_steps, "interfaces", list)
    status, out, err = command()
    assert (status, out) == (2, "")
    assert [line.split()[:2] for line in err.splitlines() if line.startswith("  tailbyte")] == [
        ["tailbyte", name] for name in ("simulate", "info", "check", "decode", "live")
    ]
    assert max(map(len, err.splitlines())) <= 80
    for line in re.findall(r"^  (tailbyte .*?)  ", err, re.MULTILINE):
        parser().parse_args(shlex.split(line)[1:])


def test_alone_it_takes_a_capture_that_is_there(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(first_steps, "interfaces", lambda: ["can7"])
    for name in ("x.py", ".hidden.log", "-r.log", "a\x1b.log", "notes.txt", "x" * 99 + ".log"):
        (tmp_path / name).touch()
    (tmp_path / "folder.log").mkdir()
    assert "tailbyte info flight.log" in command()[2]
    (tmp_path / "my flight.mcap.gz").touch()
    err = command()[2]
    assert "  tailbyte info 'my flight.mcap.gz'" in err
    assert "  tailbyte live can7" in err
    assert "simulate" not in err
    assert len([line for line in err.splitlines() if line.startswith("  tailbyte")]) == len(FIRST)
    monkeypatch.setattr(first_steps.os, "scandir", lambda: (_ for _ in ()).throw(PermissionError()))
    assert first_steps.newest_capture() == ""


def test_names_of_captures_are_those_of_the_formats() -> None:
    known = {suffix for form in FORMATS for suffix in form.suffixes}
    assert known - set(first_steps.SUFFIXES) == {".csv"}


def test_interfaces_are_those_of_the_kernel(tmp_path: Path) -> None:
    for name, kind in (("vcan1", "280"), ("eth0", "1"), ("can0", "280")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "type").write_text(f"{kind}\n")
    (tmp_path / "bonding_masters").touch()
    assert here.interfaces(str(tmp_path)) == ["can0", "vcan1"]
    assert here.interfaces(str(tmp_path / "none")) == []


def test_the_package_is_a_program() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "analyzer", "decod"], env=environment(), capture_output=True, timeout=LIMIT, check=False
    )
    assert (done.returncode, done.stdout) == (2, b"")
    assert done.stderr == b"tailbyte: no command decod; did you mean tailbyte decode?\n"
