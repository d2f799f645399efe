"""Interfaces with long names stay apart where their column is narrow, and are whole where there is no width."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES

from analyzer.views.terminal import display_width, fit_name

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

NAMES = [f"can-left-front-number-{k}" for k in range(12)]


@pytest.fixture
def many(tmp_path: Path) -> Path:
    lines = [line.split() for line in (CAPTURES / "hover.log").read_text().splitlines()]
    path = tmp_path / "many.log"
    path.write_text("".join(f"{t} {NAMES[k % 12]} {frame}\n" for k, (t, _, frame) in enumerate(lines)))
    return path


@pytest.mark.parametrize("name", ["can0", "can-left-front-number-11", "漢字漢字漢字漢字漢字", "e\u0301" * 20, ""])
@pytest.mark.parametrize("width", [1, 2, 3, 6, 16, 40])
def test_a_name_is_cut_in_its_middle(name: str, width: int) -> None:
    found = fit_name(name, width)
    assert display_width(found) <= width
    assert found == name or (found.count("…") == 1 and name.endswith(found.partition("…")[2]))


@pytest.mark.parametrize("args", [("info",), ("stats", "nodes"), ("stats", "load"), ("stats", "talkers")])
def test_names_differ_at_80_columns(
    command: Command, monkeypatch: pytest.MonkeyPatch, many: Path, args: tuple[str, ...]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    _, out, _ = command(*args, many)
    shown = [line.split()[0].partition("…") for line in out.splitlines() if line.startswith("can-")]
    assert shown
    for start, _, end in shown:
        assert sum(name.startswith(start) and name.endswith(end) for name in NAMES) == 1 or start in NAMES
    assert all(display_width(line) <= 80 for line in out.splitlines())


@pytest.mark.parametrize("more", [(), ("--frame-list",)])
def test_names_are_whole_in_a_file(command: Command, many: Path, more: tuple[str, ...]) -> None:
    _, out, _ = command("decode", many, *more)
    shown = [word for line in out.splitlines()[1:] for word in line.split() if word.startswith("can-")]
    assert shown
    assert set(shown) <= set(NAMES)
