"""Pages of rules for any bus: beside the code that finds them, in the folder of their layer, or in decorators."""

from __future__ import annotations

import ast
import tomllib
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from kit.judged import registry

from analyzer import rules
from analyzer.rules.catalogue import LAYERS, layer_packages, load
from analyzer.rules.discovery import conformances_of, new_rules
from dissectors.pages import read_pages
from dissectors.toml_table import ProfileError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

ROOT = Path(rules.__path__[0])
FILES = sorted(ROOT.rglob("*.toml"))
PAGE = '''"""A small rule."""
from dissectors.kit import rule

@rule(
    "CAN-099", title="t", severity="note",
    origin="heuristic",
    checks="c",
    matters="m", example="e", next="n",
    text="{length} bytes", exercised="frames",
)
def first(view):
    """Find nothing."""
    return ()
'''


@pytest.mark.parametrize("file", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_page_stands_beside_its_code_in_the_folder_of_its_layer(file: Path) -> None:
    pages = tomllib.loads(file.read_text())
    code = file.with_suffix(".py").read_text()
    named = {node.value for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Constant)}
    assert pages.keys() <= named
    assert {LAYERS[rule.partition("-")[0]] for rule in pages} == {file.parent.name}


def test_every_rule_that_runs_has_a_page_and_every_page_a_rule_that_runs() -> None:
    pages = load(registry())
    running = list(new_rules(registry(), pages, conformances_of(registry())))
    assert {code for one in running for code in one.rules} == pages.keys()


@pytest.fixture
def frames(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[ModuleType]:
    """The package of rules about frames, with another folder."""
    package = import_module("analyzer.rules.frames")
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
    load.cache_clear()
    yield package
    load.cache_clear()


def test_a_page_in_a_decorator_is_found_without_running_it(frames: ModuleType) -> None:
    assert frames in list(layer_packages())
    (Path(frames.__path__[-1]) / "small.py").write_text(f"{PAGE}\nraise SystemExit\n")
    page = load(registry())["CAN-099"]
    assert (page.title, page.category, page.clause, page.enabled, page.values) == (
        "t",
        "protocol",
        "-",
        True,
        ("length",),
    )


@pytest.mark.parametrize(
    ("old", "new", "line", "reason"),
    [
        ('origin="heuristic"', 'origin="guess"', 6, "'guess' is unknown"),
        ('matters="m", ', "", 4, "matters is missing"),
        ('checks="c"', "checks=CHECKS", 7, "write the value out"),
        ("def first(view):", "def first(view:", 11, "was never closed"),
    ],
)
def test_a_mistake_in_a_page_has_file_and_line(
    frames: ModuleType, old: str, new: str, line: int, reason: str
) -> None:  # fmt: skip
    file = Path(frames.__path__[-1]) / "small.py"
    file.write_text(PAGE.replace(old, new))
    with pytest.raises(ProfileError, match=reason) as error:
        load(registry())
    assert (error.value.file, error.value.line) == (str(file), line)


def test_a_page_in_a_decorator_and_one_in_a_file_do_not_mix(tmp_path: Path) -> None:
    (tmp_path / "small.py").write_text(PAGE)
    assert list(read_pages(tmp_path / "small.py").body) == ["CAN-099"]
    with pytest.raises(TypeError, match="a page is that of one rule"):
        exec(PAGE.replace('"CAN-099",', '"CAN-099", "CAN-098",'))
