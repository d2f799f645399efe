"""The reference in dissectors/README.md is that of the keys and names there are.

python -m dissectors.reference dissectors/README.md     # writes it anew
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import dissectors
from dissectors import keys, kit, reference

README = Path(dissectors.__file__).with_name("README.md")


def test_the_reference_is_up_to_date() -> None:
    assert README.read_text() == reference.renewed(README.read_text())


def test_every_public_name_of_the_kit_has_a_line() -> None:
    text = reference.reference().partition("## The kit")[2]
    rows = re.findall(r"^\| `(\w+)[(`].*\| (.+) \|$", text, re.MULTILINE)
    assert sorted(name for name, _ in rows) == sorted(kit.__all__)
    assert all(about.endswith((".", "`")) for _, about in rows)


def test_every_file_and_key_is_there() -> None:
    text = reference.reference()
    for file in keys.FILES:
        assert f"### `{file.title}`" in text
        assert all(f"| `{key.name}` | {key.type.replace('|', chr(92) + '|')} | " in text for key in file.keys)


def test_it_is_written_between_its_comments(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{reference.BEGIN}old\n{reference.END}after\n")
    assert reference.main([str(page)]) == 0
    assert page.read_text() == f"before\n{reference.BEGIN}\n{reference.reference()}\n{reference.END}after\n"
    with pytest.raises(ValueError, match="reference: begin"):
        reference.renewed("no comments")


def test_it_is_printed_without_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert reference.main([]) == 0
    assert capsys.readouterr().out == reference.reference()
