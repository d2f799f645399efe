"""`tailbyte triage`, and the name of a capture alone."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from jsonschema import Draft202012Validator

from analyzer.cli import main
from analyzer.report.triage.json import schema

if TYPE_CHECKING:
    from collections.abc import Iterator

CAPTURES = Path(__file__).resolve().parents[2] / "captures"
ALL = sorted(path for path in CAPTURES.iterdir() if path.suffix in {".log", ".mcap"})
CRASH = CAPTURES / "propeller-lost.log"


def lines(text: str) -> Iterator[str]:
    yield from re.sub(r"\x1b\[[0-9;]*m", "", text).splitlines()


@pytest.mark.parametrize("path", ALL, ids=lambda path: path.name)
def test_the_screen_fits_a_terminal(path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["triage", str(path)]) in (0, 3, 4)
    shown = list(lines(capfd.readouterr().out))
    assert len(shown) <= 24
    assert any(line.startswith("What broke first") for line in shown)
    assert [line for line in shown if len(line) > 80 and "tailbyte " not in line] == []


@pytest.mark.parametrize("path", ALL, ids=lambda path: path.name)
def test_json_is_as_its_schema_says(path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    main(["triage", str(path), "--json", "-"])
    found = json.loads(capfd.readouterr().out)
    Draft202012Validator(schema()).validate(found)
    assert found["verdicts"][0]["title"]
    assert found["capture"] == [str(path)]


def test_a_capture_alone_is_triage(capfd: pytest.CaptureFixture[str]) -> None:
    assert main([str(CRASH)]) == 0
    alone = capfd.readouterr().out
    assert main(["triage", str(CRASH)]) == 0
    assert capfd.readouterr().out == alone
    assert "ch4 (node 14): lost the load of its motor" in alone


def test_a_command_wins_over_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "info").write_bytes(CRASH.read_bytes())
    monkeypatch.chdir(tmp_path)
    assert main(["info", str(CRASH)]) == 0
    assert capfd.readouterr().out.startswith("File")
    assert main(["./info"]) == 0
    assert "What broke first" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["can0"], "did you mean tailbyte live can0?"),
        (["nothing-here.log"], "no such file"),
        (["decod"], "did you mean tailbyte decode"),
        ([str(CRASH), "check"], "the command comes first"),
    ],
)
def test_what_is_no_capture_is_told(words: list[str], hint: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    assert hint in capfd.readouterr().err


@pytest.mark.parametrize(
    ("text", "said", "ended"),
    [
        ("(1.0) can0 123#1122\n(2.0) can0 124#1122\n", "no transfer of DroneCAN", 4),
        ("(1.0) can0 1801550A#0000000000000000C0\n".replace("00C0", "C0"), "no ESC reports, nobody was armed", 0),
    ],
)
def test_what_cannot_be_judged_says_why(
    text: str, said: str, ended: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "x.log"
    path.write_text(text)
    assert main(["triage", str(path)]) == ended
    assert said in capfd.readouterr().out


def test_without_times_nothing_is_invented(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "timeless.log"
    path.write_text("".join(f"{line.split(' ', 1)[1].replace(' ', '  ')}\n" for line in CRASH.read_text().splitlines()))
    assert main(["triage", str(path)]) == 4
    assert "the capture has no times" in capfd.readouterr().out


def test_a_damaged_capture_is_told_as_far_as_it_goes(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "cut.log"
    text = CRASH.read_bytes()
    path.write_bytes(text[: len(text) * 9 // 10] + b"\n\xff\x00 damaged\n")
    assert main(["triage", str(path)]) == 3
    assert "What broke first" in capfd.readouterr().out


def test_words_of_a_capture_do_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The name of a file is text of somebody else, too."""
    path = tmp_path / "a\x1b[31m`<b>`.log"
    path.write_bytes(CRASH.read_bytes())
    assert main(["triage", str(path), "--markdown", "-"]) == 0
    text = capfd.readouterr().out
    assert "\x1b" not in text
    assert text.count("`") == 2
    assert main(["triage", str(path)]) == 0
    assert "\x1b" not in capfd.readouterr().out


def test_one_flight_of_several(capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["triage", str(CRASH), "--flight", "1"]) == 0
    assert "lost the load" in capfd.readouterr().out
    assert main(["triage", str(CRASH), "--flight", "2"]) == 2
    assert "no flight 2" in capfd.readouterr().err


def test_the_story_marks_what_began_it(capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["triage", str(CRASH), "--story"]) == 0
    marked = [line for line in lines(capfd.readouterr().out) if line.startswith("*")]
    assert len(marked) == 1
    assert "ch4" in marked[0]
    assert "motor:" in marked[0]


@pytest.mark.parametrize("kind", ["esc", "wiring", "unknown", "commands-lost"])
def test_explain_has_a_page_of_each_verdict(kind: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", kind]) == 0
    text = capfd.readouterr().out
    assert text.startswith(kind)
    assert {"For it", "Against", "Near", "Next"} <= {line[:10].strip() for line in text.splitlines()}


@pytest.mark.sampled(6)
@pytest.mark.parametrize("path", ALL, ids=lambda path: path.name)
def test_check_says_it_too(capfd: pytest.CaptureFixture[str], tmp_path: Path, path: Path) -> None:
    """The verdict that `check` has in its head is that of `triage`, whatever the number of threads."""
    main(["triage", str(path), "--json", str(tmp_path / "triage.json")])
    found = json.loads((tmp_path / "triage.json").read_text())
    told = []
    for threads in ("1", "2"):
        main(["check", str(path), "--threads", threads, "--json", str(tmp_path / "check.json")])
        told.append(json.loads((tmp_path / "check.json").read_text())["captures"][0]["triage"])
    assert told[0] == told[1], path.name
    assert (told[0] is None) == (not found["flights"]), path.name
    if told[0] is not None:
        first = found["verdicts"][0]
        assert {name: told[0][name] for name in ("kind", "title", "t_ns", "node")} == {
            name: first[name] for name in ("kind", "title", "t_ns", "node")
        }
    capfd.readouterr()
