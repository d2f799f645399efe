"""Limits and enumerations in the notes of any dissector are judged; Python of a folder runs only if it is trusted."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import pytest
from kit import encode
from kit.traffic import MS, START

import analyzer
import dissectors

if TYPE_CHECKING:
    from pathlib import Path

TYPE = 20900
LAYOUT = "uint8 state\nuint16 pressure\nfloat32 flow\nuint8 word\nint8[<=4] steps\n"
PROFILE = """\
name = "Acme"
tree = "."

[message.Pump]
type = "acme.Pump"

[message.Pump.field.state]
enum = { 0 = "idle", 1 = "running" }
special = { 255 = "unknown" }

[message.Pump.field.pressure]
unit = "bar"
scale = 0.1
high = 150

[message.Pump.field.flow]
unit = "l/min"
low = -1.5
high = 20

[message.Pump.field.word.bits]
valve = { at = "0-3", enum = { 0 = "shut", 1 = "open" } }
gear = { at = "4-7", low = 1, high = 6 }

[message.Pump.field.steps]
low = -3
high = 3
"""
GOOD = {"state": 1, "pressure": 100, "flow": 3.5, "word": 0x31, "steps": (1, -3, 3)}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "acme" / "acme").mkdir(parents=True)
    (tmp_path / "acme" / "acme" / f"{TYPE}.Pump.uavcan").write_text(LAYOUT)
    (tmp_path / "acme" / "profile.toml").write_text(PROFILE)
    return tmp_path / "acme"


def log(folder: Path, *wrong: dict[str, object]) -> Path:
    """Thirty good reports and then those that are `wrong`, a tenth of a second apart."""
    signature = dissectors.load([folder]).resolve("Pump").signature
    lines = []
    for k, values in enumerate([*[GOOD] * 30, *(GOOD | one for one in wrong)]):
        steps = struct.pack(f"{len(values['steps'])}b", *values["steps"])
        body = struct.pack("<BHfB", values["state"], values["pressure"], values["flow"], values["word"]) + steps
        sent = encode.Transfer("message", TYPE, 20, body, signature, k % 32)
        lines += [encode.log_line(frame) + "\n" for frame in sent.frames(START + k * 100 * MS)]
    path = folder.parent / "pump.log"
    path.write_text("".join(lines))
    return path


def told(folder: Path, *wrong: dict[str, object]) -> list[tuple[str, str, int, str]]:
    report = analyzer.check(log(folder, *wrong), dissectors_=[folder])
    return [(one.rule, one.severity, one.count, one.text) for one in report.findings if one.rule.startswith("TYP")]


@pytest.mark.parametrize(
    ("wrong", "rule", "text"),
    [
        ({"state": 7}, "TYP-014", "state = 7, named are 0 idle, 1 running"),
        ({"pressure": 299}, "TYP-013", "pressure = 29.9 bar, at most 15 allowed"),
        ({"pressure": 151}, "TYP-013", "pressure = 15.1 bar, at most 15 allowed"),
        ({"flow": 20.25}, "TYP-013", "flow = 20.25 l/min, -1.5 to 20 allowed"),
        ({"flow": -1.75}, "TYP-013", "flow = -1.75 l/min, -1.5 to 20 allowed"),
        ({"word": 0x32}, "TYP-014", "word.valve = 2, named are 0 shut, 1 open"),
        ({"word": 0x71}, "TYP-013", "word.gear = 7, 1 to 6 allowed"),
        ({"steps": (0, 5, 9)}, "TYP-013", "steps = 5, -3 to 3 allowed"),
    ],
)
def test_what_the_notes_do_not_allow_is_found(folder: Path, wrong: dict[str, object], rule: str, text: str) -> None:
    assert told(folder, wrong) == [(rule, "warning", 1, text)]


@pytest.mark.parametrize(
    "fine",
    [{}, {"state": 255}, {"pressure": 150}, {"flow": 20.0}, {"flow": -1.5}, {"word": 0x60}, {"steps": ()}],
    ids=str,
)
def test_what_they_allow_is_not(folder: Path, fine: dict[str, object]) -> None:
    assert told(folder, fine) == []


def test_not_a_number_belongs_to_another_rule(folder: Path) -> None:
    assert [one[0] for one in told(folder, {"flow": float("nan")})] == ["TYP-007"]


def test_every_wrong_report_counts(folder: Path) -> None:
    assert told(folder, {"state": 7}, {"state": 7}, {"state": 8}) == [
        ("TYP-014", "warning", 2, "state = 7, named are 0 idle, 1 running"),
        ("TYP-014", "warning", 1, "state = 8, named are 0 idle, 1 running"),
    ]


CODE = """\
from pathlib import Path
from dissectors import kit

Path(__file__).with_name("it-ran").touch()

@kit.rule("ACME-001", title="Always", severity="error", origin="implied", checks="c", matters="m", example="e",
          next="n", text="t", exercised="type:Pump")
def always(view):
    table = view.table("Pump")
    if table is not None:
        yield view.among_rows("ACME-001", table, table.trusted.nonzero()[0], lambda row: {})

CONFORMANCE = kit.Conformance(rules=(always,))
"""


def test_python_of_a_folder_runs_only_if_it_is_trusted(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from analyzer.cli import main  # noqa: PLC0415 - as a user calls it

    path = log(folder)
    (folder / "profile.toml").write_text('rules = "rules.py"\n' + PROFILE)
    (folder / "rules.py").write_text(CODE)
    monkeypatch.chdir(folder.parent)
    assert main(["check", str(path), "--dissector", "acme"]) == 0
    out, err = capsys.readouterr()
    assert "its rules in Python (rules.py) do not run without --trust-dissector" in err
    assert "ACME" not in out
    assert not (folder / "it-ran").exists()
    assert main(["check", str(path), "--trust-dissector", "acme"]) == 1
    out, err = capsys.readouterr()
    assert "ACME-001" in out
    assert f"tailbyte decode {path} --trust-dissector acme" in out
    assert "Python" not in err
    assert (folder / "it-ran").exists()
    report = analyzer.check(path, dissectors_=[folder])
    assert not any(one.rule.startswith("ACME") for one in (*report.findings, *report.rules))
    report = analyzer.check(path, dissectors_=[folder], trust_dissectors=True)
    assert any(one.rule == "ACME-001" for one in report.findings)
