"""What the pages point to is there: links, files in code type, names of the glossary, the list of layers."""

from __future__ import annotations

import ast
import importlib
import re
from typing import TYPE_CHECKING, Any

import pytest
from kit.pages import MANUAL, PAGES, ROOT, name_of, prose, spans

if TYPE_CHECKING:
    from pathlib import Path

LINK = re.compile(r"\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)
INSIDE = (".ci", ".github", "analyzer", "captures", "dissectors", "tests")
WORDS = (ROOT / "analyzer" / "README.md").read_text()
GLOSSARY = re.findall(r"^\| ([^|]+) \| [^|]+ \| `([\w.]+)` \|$", WORDS, re.MULTILINE)
ROW = re.compile(r"^\| ([^|`\[]+) \| [^|]+ \| (?:`[\w.]+` )?\|$", re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """The names that GitHub gives to headings."""
    plain = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in HEADING.findall(prose(page)))
    return {heading.strip().replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page: Path) -> None:
    for target in LINK.findall(prose(page)):
        if target.startswith("https://"):
            continue
        name, _, anchor = target.partition("#")
        to = page.parent / name if name else page
        assert to.exists(), target
        assert to.resolve().is_relative_to(ROOT), target
        assert not anchor or anchor in anchors(to), target


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_files_that_are_named_exist(page: Path) -> None:
    text = prose(page)
    named = {word.rstrip(".,:") for span in spans(page) for word in span.split() if word.split("/")[0] in INSIDE}
    for name in sorted(named):
        if "/" in name and not re.search(r"[*<>~…]|\.\.\.", name):
            assert (ROOT / name).exists(), name
    assert "/work" not in text


def test_pages_of_the_manual_are_all_in_its_contents() -> None:
    pages = {path.name for path in MANUAL.glob("*.md")} - {"README.md"}
    assert set(LINK.findall((MANUAL / "README.md").read_text())) == pages
    linked = {target.rpartition("/")[2].partition("#")[0] for target in LINK.findall((ROOT / "README.md").read_text())}
    assert linked >= pages


@pytest.mark.parametrize(("word", "name"), GLOSSARY, ids=lambda value: value)
def test_a_word_of_the_glossary_stands_in_the_code(word: str, name: str) -> None:
    parts = name.split(".")
    found: Any = None
    for at in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:at]))
        except ModuleNotFoundError:
            continue
        for part in parts[at:]:
            assert hasattr(found, part), f"{word}: no {name}"
            found = getattr(found, part)
        break
    assert found is not None, f"{word}: no {name}"


def test_a_word_is_explained_once() -> None:
    words = [word for row in ROW.findall(WORDS) for word in row.split(", ")]
    assert len(words) == len(set(words))
    assert 35 <= len(words) <= 60


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 220


def test_the_two_commands_of_a_fresh_machine() -> None:
    text = (ROOT / "README.md").read_text()
    assert "python3 -m venv .venv && .venv/bin/pip install . && .venv/bin/tailbyte decode captures/hover.log\n" in text
    assert ".venv/bin/pip install -e '.[test]' && .venv/bin/pytest\n" in text


def test_the_layers_are_those_that_the_imports_are_held_against() -> None:
    (path,) = (ROOT / "tests").rglob("test_layers.py")
    found = re.search(r"^LAYERS = (\(.*?^\))", path.read_text(), re.DOTALL | re.MULTILINE)
    assert found is not None
    assert tuple(re.findall(r"^\d+\. `([\w.]+)`$", WORDS, re.MULTILINE)) == ast.literal_eval(found[1])


def test_every_capture_is_described() -> None:
    text = (ROOT / "captures" / "README.md").read_text()
    captures = [path for path in (ROOT / "captures").iterdir() if path.suffix in (".log", ".txt", ".mcap")]
    assert [path.name for path in captures if f"| `{path.name}` |" not in text] == []
    assert len(captures) > 10
