"""The command help: topics, commands, near names, pages that are missing, the terminal."""

from __future__ import annotations

import io
import sys
from importlib import resources
from typing import TYPE_CHECKING

import pytest
from kit.command import SGR
from kit.pages import MANUAL

from analyzer.cli import main
from analyzer.cli.commands import COMMANDS
from analyzer.views.terminal import display_width

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

TOPICS = sorted(path.stem for path in MANUAL.glob("*.md") if path.stem != "README")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_alone_it_lists_every_topic_with_a_line(command: Command) -> None:
    status, out, err = command("help")
    assert (status, err) == (0, "")
    lines = [line.split(maxsplit=1) for line in out.splitlines()]
    assert sorted(line[0] for line in lines if len(line) == 2 and line[0] in TOPICS) == TOPICS
    assert len(TOPICS) > 15
    assert max(map(display_width, out.splitlines())) <= 80


@pytest.mark.parametrize("topic", TOPICS)
def test_a_page_is_named_as_its_topic(command: Command, topic: str) -> None:
    status, out, err = command("help", topic)
    assert (status, err) == (0, "")
    assert out.startswith(f"{topic}: ")
    assert "\x1b" not in out
    assert max(map(display_width, out.splitlines())) <= 80


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_has_a_page_that_says_where_its_options_are(command: Command, name: str) -> None:
    status, out, _ = command("help", name)
    assert status == 0
    assert f"tailbyte {name}" in out
    assert out.endswith(f"All options: tailbyte {name} --help.\n") or name == "help"


@pytest.mark.parametrize(
    ("topic", "hint"),
    [
        ("vehicel", "did you mean tailbyte help vehicle?"),
        ("exit", "did you mean tailbyte help exit-status?"),
        ("trf-010", "did you mean tailbyte explain TRF-010?"),
        ("../check", "did you mean tailbyte help check?"),
        ("", "tailbyte help lists all"),
        ("\x1b[31mqqqq", "tailbyte help lists all"),
    ],
)
def test_an_unknown_topic_is_one_line_with_near_names(command: Command, topic: str, hint: str) -> None:
    status, out, err = command("help", topic)
    assert (status, out) == (2, "")
    assert err.startswith("tailbyte help: no page '")
    assert err.endswith(f"; {hint}\n")
    assert err.count("\n") == 1
    assert "\x1b" not in err


def test_a_missing_page_is_one_line(command: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(resources, "files", lambda _: tmp_path)
    status, out, err = command("help")
    assert (status, out, err.count("\n")) == (3, "", 1)
    (tmp_path / "manual").mkdir()
    (tmp_path / "manual" / "README.md").write_text("| [check](check.md) | all |\n")
    status, out, err = command("help", "check")
    assert (status, out, err.count("\n")) == (3, "", 1)
    assert "check.md" in err
    (tmp_path / "manual" / "check.md").write_bytes(b"\xff")
    assert command("help", "check")[0] == 3
    assert command("help")[0] == 0


@pytest.mark.parametrize("columns", [80, 200])
def test_on_a_terminal_it_is_as_wide_and_has_colours(monkeypatch: pytest.MonkeyPatch, columns: int) -> None:
    monkeypatch.setattr(sys, "stdout", Terminal())
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert main(["help", "check", "--no-pager"]) == 0
    shown = sys.stdout.getvalue()
    assert "\x1b[1m" in shown
    widest = max(map(display_width, SGR.sub("", shown).splitlines()))
    assert (widest <= 80) is (columns == 80)
    assert widest <= columns
