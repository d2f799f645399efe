"""Files of a dissector folder that would never end, or that a parser works on for minutes, are refused."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import pytest

import dissectors
from dissectors import DsdlError, ProfileError
from dissectors.pages import page_files, read_pages
from dissectors.toml_table import parse

if TYPE_CHECKING:
    from pathlib import Path


def everything(folder: Path) -> None:
    """Read whatever of a folder is read."""
    dissectors.load([folder])
    for file in page_files(folder):
        read_pages(file)


@pytest.mark.parametrize("name", ["20000.Thing.uavcan", "rules.toml", "rules/one.py", "rules/one.toml", "profile.toml"])
def test_a_pipe_is_no_file(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "vendor"
    (folder / "rules").mkdir(parents=True)
    everything(folder)
    os.mkfifo(folder / name)
    with pytest.raises((ProfileError, DsdlError), match="is not a regular file"):
        everything(folder)


@pytest.mark.parametrize("form", ["{} = 1", "[{}]", "[[{}]]", "x = {{ {} = 1 }}"])
@pytest.mark.parametrize("part", ["a", '"a b"', "'a'"])
@pytest.mark.parametrize("dot", [".", " . "])
def test_long_dotted_keys_are_refused_before_they_are_parsed(form: str, part: str, dot: str) -> None:
    key = dot.join([part] * 5000)
    with pytest.raises(ProfileError, match=r"a\.toml:2: more than 16 parts of a dotted key"):
        parse(f"# first\n{form.format(key)}\n".encode(), "a.toml")
    assert parse(form.format(dot.join([part] * 16)).encode(), "a.toml").body
