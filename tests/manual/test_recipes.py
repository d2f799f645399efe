"""The recipes of analyzer/README.md, followed to the letter in a copy of the program.

The first line of a block says where it belongs: `# PATH` is a new file, `# PATH, in NAME` a line for that table.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from kit.pages import ROOT, Block, blocks_of

if TYPE_CHECKING:
    from pathlib import Path

README = (ROOT / "analyzer" / "README.md").read_text()
RECIPES = {
    title: blocks
    for title, text in re.findall(r"^### (\d+\. [^\n]+)\n(.*?)(?=^##)", README, re.DOTALL | re.MULTILINE)
    if (blocks := [block for block in blocks_of(text) if block.kind == "python"])
}


def place(block: Block) -> tuple[str, str]:
    assert block.place is not None, f"where does this belong? {block.text}"
    return block.place


def follow(block: Block, program: Path) -> None:
    name, table = place(block)
    text = block.text.partition("\n")[2]
    path = program / name
    if not table:
        assert not path.exists(), f"{name} is there already"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return
    before = path.read_text()
    start = re.search(rf"^{table}\b[^\n]*= [(\[{{]\n", before, re.MULTILINE)
    assert start, f"no table {table} in {name}"
    path.write_text(before[: start.end()] + text + before[start.end() :])


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What pytest says of the tests that the recipes hold, once all of them have been followed."""
    program = tmp_path_factory.mktemp("program")
    for package in ("analyzer", "dissectors"):
        leave = shutil.ignore_patterns("native", "*.md")
        shutil.copytree(ROOT / package, program / package, ignore=leave)
    (program / "captures").symlink_to(ROOT / "captures")
    (program / "pytest.ini").write_text("[pytest]\naddopts = --import-mode=importlib -p no:cacheprovider -n0 -rA -q\n")
    tests = []
    for block in (block for recipe in RECIPES.values() for block in recipe):
        follow(block, program)
        if (name := place(block)[0]).startswith("tests/"):
            tests.append(name)
    run = [sys.executable, "-P", "-m", "pytest", "-c", "pytest.ini", *tests]
    done = subprocess.run(
        run, cwd=program, env={"PYTHONPATH": str(program)}, capture_output=True, text=True, check=False
    )
    return done.stdout + done.stderr


def test_there_are_recipes() -> None:
    assert [title.partition(".")[0] for title in RECIPES] == [str(number) for number in range(1, 5)]


@pytest.mark.slow
@pytest.mark.parametrize("recipe", RECIPES)
def test_a_recipe_works(ran: str, recipe: str) -> None:
    tests = [name for block in RECIPES[recipe] if (name := place(block)[0]).startswith("tests/")]
    assert tests, "a recipe without a test"
    for name in tests:
        assert f"PASSED {name}::" in ran, ran
        assert f"FAILED {name}" not in ran, ran


def test_their_lines_fit_the_page() -> None:
    lines = [line for recipe in RECIPES.values() for block in recipe for line in block.text.splitlines()]
    assert max(map(len, lines)) <= 120
