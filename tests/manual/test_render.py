"""Markdown on a terminal: what is kept, what is wrapped, and that nothing in it can harm."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.command import SGR
from kit.pages import MANUAL, PAGES, blocks, name_of
from kit.strategies import examples

from analyzer.views.page.markdown import render
from analyzer.views.terminal import Palette, display_width

TABLE = "| key | says |\n|---|---:|\n| `a` | one |\n| bb | *two* words |\n"


def test_headings_and_paragraphs() -> None:
    text = "# Title\none\ntwo **bold** `code`-d\n\n## Part\n\n### Small\nend\n"
    assert render(text) == "Title\n=====\n\none two bold code-d\n\nPart\n----\n\nSmall\n\nend\n"
    shown = render(text, palette=Palette(on=True))
    assert "\x1b[1mTitle\x1b[0m" in shown
    assert "\x1b[36mcode\x1b[0m-d" in shown
    assert SGR.sub("", shown) == render(text)


def test_a_table_has_columns() -> None:
    assert render(TABLE) == "key       says\n---  ---------\na          one\nbb   two words\n"


def test_a_table_without_a_header_has_no_line() -> None:
    assert render("| | |\n|---|---|\n| a | one |\n") == "a  one\n"


def test_a_wide_table_is_wrapped_in_its_columns() -> None:
    lines = render(f"| a | b |\n|---|---|\n| short | {'word ' * 30}|\n| {'x' * 200} | end |\n", width=60).splitlines()
    assert max(map(len, lines)) <= 60
    assert lines[2].startswith("short ")
    assert lines[3].startswith(" " * 20)
    assert "".join(lines).count("word") == 30
    assert "".join(lines).count("x") == 200


def test_code_stands_as_it_is() -> None:
    assert render("```sh\na  b\n\n  c\n```\n") == "  a  b\n\n    c\n"
    wide = "x" * 79
    assert render(f"```\n{wide}\n```\n") == f"{wide}\n"


def test_lists_hang() -> None:
    shown = render(
        "- one\n  two\n- three\n\n1. first " + "word " * 20 + "\n2. second\n\n   ```sh\n   run\n   ```\n", width=60
    )
    assert shown.startswith("- one two\n- three\n\n1. first word")
    assert "\n   word" in shown
    assert "\n2. second\n\n     run\n" in shown


@pytest.mark.parametrize(
    ("link", "shown"),
    [
        ("see [check](check.md)", "see tailbyte help check"),
        ("see [Safety](interfaces.md#safety).", "see Safety (tailbyte help interfaces)."),
        ("[Rerun](https://rerun.io) shows", "Rerun (https://rerun.io) shows"),
        ("[`a/b.py`](../a/b.py) says", "a/b.py says"),
        ("![a picture](x.png)", ""),
        ("[check](check.md)", "check"),
    ],
)
def test_links_say_how_to_follow_them_here(link: str, shown: str) -> None:
    assert render(link) == (f"{shown}\n" if shown else "")


@examples(50)
@given(st.text(max_size=200), st.integers(1, 300), st.booleans())
def test_whatever_stands_there_is_harmless(text: str, width: int, on: bool) -> None:
    shown = render(text, width=width, palette=Palette(on))
    assert SGR.sub("", shown).replace("\n", "").isprintable()


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_page_fits_80_columns(page: object) -> None:
    text = page.read_text()
    shown = render(text, width=80)
    limit = 80 if page.parent == MANUAL else 120
    assert max(map(display_width, shown.splitlines())) <= limit
    for block in blocks(page):
        for line in filter(None, block.text.splitlines()):
            assert line in shown
