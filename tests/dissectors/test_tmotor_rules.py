"""T-Motor's rules stand beside their pages, and none is forgotten."""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path

import pytest

import dissectors
from analyzer.rules.catalogue import load
from dissectors.pages import page_files
from dissectors.tmotor import rules
from dissectors.toml_table import ProfileError

ROOT = Path(rules.__file__).parent
FILES = sorted(path for path in ROOT.rglob("*.toml"))


@pytest.mark.parametrize("file", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_page_stands_beside_its_code(file: Path) -> None:
    pages = tomllib.loads(file.read_text())
    code = file.with_suffix(".py")
    strings = set()
    if code.exists():
        strings = {node.value for node in ast.walk(ast.parse(code.read_text())) if isinstance(node, ast.Constant)}
    assert pages
    assert {rule for rule, page in pages.items() if not page.get("tests")} <= strings


def test_every_rule_has_a_page_and_every_page_a_rule() -> None:
    paged = {rule: page for file in FILES for rule, page in tomllib.loads(file.read_text()).items()}
    coded = {code for one in rules.CONFORMANCE.rules for code in one.rules}
    assert coded == {rule for rule, page in paged.items() if not page.get("tests")}
    assert len(rules.CONFORMANCE.rules) == len(set(rules.CONFORMANCE.rules)) > 50


def test_a_rule_with_two_pages_is_a_mistake(tmp_path: Path) -> None:
    (tmp_path / "profile.toml").write_text('name = "Two"\nversion = "1"\ntree = "."\n')
    page = FILES[0].read_text()
    (tmp_path / "rules.toml").write_text(page)
    (tmp_path / "rules").mkdir()
    (tmp_path / "rules" / "again.toml").write_text(page)
    assert page_files(tmp_path) == [tmp_path / "rules.toml", tmp_path / "rules" / "again.toml"]
    with pytest.raises(ProfileError, match=r"again\.toml:\d+: BUS-032: another file has a page of this rule, too"):
        load(dissectors.load([tmp_path]))
