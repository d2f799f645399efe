"""What was parsed before it is shipped is what the files say."""

from __future__ import annotations

import subprocess
import sys

import pytest
from bench import parse_toml
from kit import ROOT

from dissectors import registry
from dissectors.keys import parsed

PROFILE = ROOT / "dissectors" / "tmotor" / "profile.toml"
NAME = "TM-UAVCAN"


def test_the_file_is_up_to_date() -> None:
    same = parsed.FILE.read_text(encoding="utf-8") == parse_toml.lines()
    assert same, "run: python tests/bench/parse_toml.py"


def test_a_file_that_changed_is_parsed() -> None:
    text = PROFILE.read_bytes()
    assert parsed.known(text)["name"] == NAME
    assert parsed.known(text + b"\n") is None


def test_everyone_gets_a_table_of_his_own() -> None:
    text = PROFILE.read_bytes()
    parsed.known(text)["name"] = "changed"
    assert parsed.known(text)["name"] == NAME


def test_what_json_cannot_say_is_refused() -> None:
    with pytest.raises(ValueError, match=r"a\.toml: JSON cannot say this"):
        parsed.line("a.toml", b"", {"a": {1: "number"}})


def test_dissectors_are_those_that_their_files_give(monkeypatch: pytest.MonkeyPatch) -> None:
    def compiled() -> list[object]:
        standard, vendors = registry._own_profiles.__wrapped__()
        return [(one.name, one.undefined, one.dissector()) for one in (standard, *vendors)]

    shipped = compiled()
    monkeypatch.setattr("dissectors.toml_table.known", lambda _: None)
    assert compiled() == shipped


def test_a_tree_without_the_file_reads_its_files() -> None:
    code = (
        "import sys; from pathlib import Path; from dissectors import load; from dissectors.keys import parsed\n"
        "parsed.FILE = Path('there/is/none')\n"
        "print(len(load().carriers()), 'tomllib' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["2", "True"]
