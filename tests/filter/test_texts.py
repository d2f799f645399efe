"""Texts of the bus that are not ASCII: one decoding in every view, and a filter finds what is shown."""

from __future__ import annotations

import contextlib
import io
import json
import re
from typing import TYPE_CHECKING

import pytest
from kit.encode import Bus, log_line, transfer

import analyzer
from analyzer.cli import main
from dissectors.kit.cells import text_of

if TYPE_CHECKING:
    from pathlib import Path

CAFE = "caf\u00e9"
TEXTS = {
    b"GPS antenna open": "GPS antenna open",
    "GPS antenna g\u00e9n\u00e9rale".encode(): "GPS antenna g\u00e9n\u00e9rale",
    b"GPS antenna g\xe9n\xe9rale": "GPS antenna g\\xe9n\\xe9rale",
    b"antenna\ttab": "antenna\ttab",
    b"\xff\xff\xff": "\\xff\\xff\\xff",
    b"cut\0antenna": "cut",
    b"blank  ": "blank",
    b"": "",
}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    bus = Bus()
    for k, text in enumerate(TEXTS):
        fields = {"level": {"value": 1}, "source": list(CAFE.encode()), "text": list(text)}
        sent = transfer("uavcan.protocol.debug.LogMessage", fields, 42, k)
        bus.send((k + 1) * 100_000_000, sent.frames())
    path = tmp_path_factory.mktemp("texts") / "texts.log"
    path.write_text("".join(f"{log_line(frame)}\n" for frame, _ in bus.run()))
    return path


def found(log: Path, said: str) -> list[int]:
    """Return the messages that a filter finds, by transfer ID."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert main(["decode", str(log), "-T", "jsonl", "-Y", said]) == 0
    return [json.loads(line)["transfer_id"] for line in out.getvalue().splitlines()]


def test_the_core_and_python_read_alike(log: Path) -> None:
    table = analyzer.open_capture(log).table("uavcan.protocol.debug.LogMessage")
    assert table.column("text.text").to_pylist() == list(TEXTS.values())
    assert [text_of(raw) for raw in TEXTS] == list(TEXTS.values())
    assert set(table.column("source.text").to_pylist()) == {CAFE}
    assert [bytes(one) for one in table.column("text").to_pylist()] == list(TEXTS)


@pytest.mark.parametrize(
    ("said", "rows"),
    [
        ('contains "antenna"', [0, 1, 2, 3]),
        ('contains "g\u00e9n"', [1]),
        (r'contains "g\xc3\xa9n"', [1]),
        (r'contains "g\xe9n"', [2]),
        (r'contains "\t"', [3]),
        (r'== "\xff\xff\xff"', [4]),
        (r'== "\377\377\377"', [4]),
        (r'contains r"\xff"', [4]),
        ('matches "G.N.RALE$"', [1]),
        ('in {"cut", "blank"}', [5, 6]),
        ('== ""', [7]),
    ],
)
def test_a_filter_finds_what_is_shown(log: Path, said: str, rows: list[int]) -> None:
    assert found(log, f"LogMessage.text {said}") == rows


def test_bytes_of_a_payload(log: Path) -> None:
    assert found(log, r'payload contains "\xff\xff"') == found(log, "payload contains ff:ff") == [4]
    assert found(log, 'payload contains "g\u00e9n"') == [1]


@pytest.mark.parametrize(
    ("options", "lines"),
    [
        (["-T", "csv", "-e", "LogMessage.text"], ["GPS antenna g\u00e9n\u00e9rale", "GPS antenna g\\xe9n\\xe9rale"]),
        (["-T", "fields", "-e", "LogMessage.text"], ["GPS antenna g\u00e9n\u00e9rale", r"antenna\x09tab"]),
        (
            ["-V"],
            [f'source: 63 61 66 C3 A9 "{CAFE}"', '"GPS antenna g\u00e9n\u00e9rale"', r'text: FF FF FF "\xff\xff\xff"'],
        ),
        ([], [f"{CAFE}: GPS antenna g\u00e9n\u00e9rale", rf"{CAFE}: GPS antenna g\xe9n\xe9rale", r"antenna\x09tab"]),
    ],
)
def test_every_view(log: Path, options: list[str], lines: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["decode", str(log), *options]) == 0
    out = capsys.readouterr().out
    assert [line for line in lines if line not in out] == []


def test_half_a_character_is_none(capsys: pytest.CaptureFixture[str], log: Path) -> None:
    assert main(["decode", str(log), "-Y", 'LogMessage.text == "\ud800"']) == 2
    assert "half of a surrogate pair is no character" in capsys.readouterr().err


@pytest.mark.parametrize("form", ["json", "jsonl"])
def test_a_text_of_digits_is_no_number(tmp_path: Path, form: str, capsys: pytest.CaptureFixture[str]) -> None:
    bus = Bus()
    for k, text in enumerate(("42", "1,2", "1e5")):
        fields = {"level": {"value": 1}, "source": [], "text": list(text.encode())}
        bus.send(k * 100_000_000, transfer("uavcan.protocol.debug.LogMessage", fields, 42, k).frames())
    path = tmp_path / "digits.log"
    path.write_text("".join(f"{log_line(frame)}\n" for frame, _ in bus.run()))
    names = ["LogMessage.text", "LogMessage.text.text", "LogMessage.level.value"]
    assert main(["decode", str(path), "-T", form, *(word for name in names for word in ("-e", name))]) == 0
    out = capsys.readouterr().out
    rows = json.loads(out) if form == "json" else list(map(json.loads, out.splitlines()))
    assert [list(row.values()) for row in rows] == [[text, text, 1] for text in ("42", "1,2", "1e5")]


@pytest.mark.parametrize(
    "arguments",
    [
        ["events"], ["events", "-T", "csv"], ["events", "-T", "json"], ["events", "-T", "jsonl"], ["stats", "events"],
        ["stats", "events", "-T", "csv"], ["triage", "--story"], ["decode"], ["decode", "-V"],
        ["decode", "-T", "fields", "-e", "LogMessage.text"], ["decode", "-T", "csv", "-e", "LogMessage.text"],
        ["check", "--all"],
    ],
)  # fmt: skip
def test_what_a_device_says_cannot_fool_a_terminal(
    tmp_path: Path, arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    said = b"\x1b[31mR\x07\xe2\x80\xae\xff\x01\xc2\x85\tE"
    fields = {"level": {"value": 3}, "source": list(b"a\x1b\x9b"), "text": list(said)}
    bus = Bus(1_773_475_330 * 10**9)
    for k in range(3):
        sent = transfer("uavcan.protocol.debug.LogMessage", fields, 42, k)
        bus.send((1_773_475_330 + k) * 10**9, sent.frames())
    path = tmp_path / "said.log"
    path.write_text("".join(f"{log_line(frame)}\n" for frame, _ in bus.run()))
    command, *options = arguments
    main(
        [command, *(["events"] if command == "stats" else []), str(path), *(one for one in options if one != "events")]
    )
    out = capsys.readouterr().out
    assert len(out) > 50
    assert not re.search("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202e]", out)
