"""The page of a rule, on a terminal and in the document of all."""

from __future__ import annotations

import re
from typing import Any

import pytest
from hypothesis import example, given
from kit.reports import NASTY, TEXTS

from analyzer.report import explain
from analyzer.views.terminal import Palette, display_width

PAGE: dict[str, Any] = {
    "title": "Transfer CRC wrong", "severity": "error", "category": "protocol", "origin": "document",
    "clause": "4.1.3, 5.1", "dronecan": "4.1 transfer CRC", "enabled": False,
    "checks": "The CRC over signature and payload. " * 4,
    "matters": "Receivers drop the transfer.", "example": "Received 0x29BE, computed 0x9EDF.",
    "next": "tailbyte decode FILE --frames A-B -x", "text": "received {crc_wire:04X}",
    "episode": "{crc_wire:04X} {lasted}", "values": ["crc_wire"],
    "key": [], "settings": {"window_s": 2.0, "most": 8}, "exercised": "type:A|pair:B>C,frames|packet:P.Q",
    "inconclusive": ["errors", "times"],
    "note": "Note for stock devices.", "also": ["TRF-011", "CAN-020"], "fault": True,
}  # fmt: skip
BARE = {**dict.fromkeys(("title", "checks", "matters", "example", "next"), "x"), "severity": "note",
        "category": "device", "origin": "heuristic", "clause": "-"}  # fmt: skip


def test_a_page() -> None:
    got = explain.render("TRF-010", PAGE).splitlines()
    assert got[0].startswith("TRF-010  Transfer CRC wrong  ")
    assert got[0].endswith("  error")
    assert [line.split("  ")[0] for line in got[1:] if line[:1].strip()] == [
        "Checks", "Matters", "Example", "Next", "Origin", "Clause", "Category", "Default", "Severity", "Settings",
        "Needs", "Proof", "Says", "Lasting", "See also",
    ]  # fmt: skip
    for line in (
        "Clause    4.1.3, 5.1; DroneCAN 4.1 transfer CRC", "Settings  window_s = 2, most = 8",
        "Needs     A or B answered by C and frames or packet P.Q", "Proof     inconclusive without: errors, times",
        "See also  TRF-011, CAN-020", "Default   off; --select turns it on",
    ):  # fmt: skip
        assert line in got


def test_a_bare_page() -> None:
    got = explain.render("BUS-028", BARE)
    assert "Origin    our judgement, no document says so" in got
    assert not re.search("Clause|Settings|Default|Needs|Proof|Says|See also|Severity", got)


@pytest.mark.parametrize("width", [1, 60, 80, 200])
def test_it_fits(width: int) -> None:
    got = explain.render("TRF-010", {**PAGE, "title": "A title of many words that goes on " * 4}, width=width)
    assert max(map(display_width, got.splitlines())) <= max(width, 60)


def test_colours_change_nothing_else() -> None:
    painted = explain.render("TRF-010", PAGE, palette=Palette(on=True))
    assert "\x1b[31merror\x1b[0m" in painted
    assert re.sub(r"\x1b\[\d+m", "", painted) == explain.render("TRF-010", PAGE)


def test_the_document() -> None:
    got = explain.document({"TRF-010": PAGE, "BUS-028": BARE})
    assert "| [TRF-010](#trf-010) | error | protocol | document | Transfer CRC wrong |" in got
    assert '<a id="trf-010"></a>\n\n## TRF-010 Transfer CRC wrong\n' in got
    assert "- Severity: error. Note for stock devices.\n" in got
    assert "- Severity: note\n" in got
    assert got.index("## TRF-010") < got.index("## BUS-028")
    assert r"received {crc\_wire:04X}" in got


@given(TEXTS)
@example("".join(NASTY))
def test_hostile_pages(nasty: str) -> None:
    parts = ("title", "checks", "matters", "example", "next", "text", "note", "clause")
    page = {**PAGE, **dict.fromkeys(parts, f"a {nasty}")}
    assert all(line.isprintable() for line in explain.render("TRF-010", page).split("\n"))
    got = explain.document({"TRF-010": page})
    assert got.count("\n") == explain.document({"TRF-010": PAGE}).count("\n")
    for active in "`*_[]<>|~@":
        assert all(
            before == "\\" for before in re.findall(rf"(.)\{active}", explain.prose(f" {nasty}")) if before != active
        )
    assert "://" not in explain.prose(nasty)


def test_a_demand_that_never_came_due() -> None:
    assert explain.needs("demand:ACME-002") == "demand of ACME-002 that came due"
