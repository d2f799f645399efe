"""Markdown for comments and step summaries, workflow commands: limits, and no way out of a code span."""

from __future__ import annotations

import re

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from kit import reports
from kit.reports import NASTY, TEXTS

from analyzer.report import github, markdown

_SPAN = re.compile(r"`[^`\n]*`")
_FENCE = re.compile(r"^```\n.*?^```\n", re.MULTILINE | re.DOTALL)
# Everything outside code spans: our own words and markup, none of it a link, a mention or a tag of somebody else.
_OURS = re.compile(r"[\w ,;:()'./+|*#❌🔴🟠🟢⚪⚠️ℹ-]*")  # noqa: RUF001 - the sign for information is meant


def outside(text: str) -> str:
    for tag in ("<details>", "</details>", "<summary>", "</summary>"):
        text = text.replace(tag, "")
    return _SPAN.sub("", _FENCE.sub("", text))


def test_a_comment() -> None:
    got = markdown.render(reports.faulty())
    assert got.startswith(
        "### 🔴 tailbyte check: FAIL\n\n1 protocol error (ch6), 1 device error (ch5), 3 warnings, 1 note\n\nWorst: "
    )
    rows = [line for line in got.splitlines() if line.startswith("| ")]
    assert [row.split(" | ")[1] for row in rows[1:]] == [
        "TRF-003",
        "TYP-306",
        "TYP-305",
        "BUS-028",
        "BUS-001",
        "CAN-013",
    ]
    assert rows[1] == (
        "| ❌ **error** | TRF-003 | ch6 node 25 ESCStatus | A frame was lost or came out of order | 3 "
        "| 2026-03-14 12:49:55.490 UTC |"
    )
    assert (
        "```\ntailbyte decode crash.log --around 41658575+-50ms\n"
        "(1773492594.890000) can0 1504021A#A75A4C02CF000040\n```" in got
    )
    assert "- error frames not recorded: CAN-004, BUS-005 inconclusive" in got
    assert got.count("<details>") == got.count("</details>") == 1


def test_what_is_excused_stands_apart() -> None:
    got = markdown.render(reports.waived())
    assert "by Ada: known since V2.2.05" in got.partition("1 finding waived or known")[2]
    assert "- requires 8 ESCs: **not met**, found 6\n" in got
    assert "**new**" in markdown.render(reports.compared())
    assert "**damaged**: `ends inside chunk 7`" in markdown.render(reports.damaged())
    assert "in `second flight.log`" in markdown.render(reports.two_captures())
    assert "Gate: nothing to judge" in markdown.render(reports.empty())


@pytest.mark.parametrize("name", reports.SAMPLES)
@pytest.mark.parametrize("limit", [1_000, 3_000, 10_000, markdown.COMMENT_BYTES, github.SUMMARY_BYTES])
def test_it_stays_below_the_limit(name: str, limit: int) -> None:
    report = reports.SAMPLES[name]()
    got = markdown.render(report, limit)
    assert len(got.encode()) <= limit
    assert got == markdown.render(reports.SAMPLES[name](), limit)
    assert got.count("<details>") == got.count("</details>")
    assert _OURS.fullmatch(outside(got).replace("\n", " "))


def test_what_has_no_room_is_counted() -> None:
    report = reports.many()
    got = markdown.render(report, 5_000)
    rows = sum(line.startswith(("| ❌", "| ⚠️", "| ℹ")) for line in got.splitlines())  # noqa: RUF001 - our sign
    assert f"and {200 - rows} more, see the JSON report" in got
    whole = github.summary(report)
    assert sum(line.startswith(("| ❌", "| ⚠️", "| ℹ")) for line in whole.splitlines()) == 200  # noqa: RUF001 - our sign
    assert "and 180 more, see the JSON report\n\n</details>" in whole


@given(TEXTS)
@example("".join(NASTY))
@example("```")
@example("`" * 9 + "|\n|---|\n# x\n- y\n</details><img src=x>")
def test_a_text_stays_in_its_span(nasty: str) -> None:
    report = reports.hostile(nasty)
    for limit in (markdown.COMMENT_BYTES, 3_000):
        got = markdown.render(report, limit)
        assert len(got.encode()) <= limit or limit == 3_000
        rest = outside(got)
        assert _OURS.fullmatch(rest.replace("\n", " "))
        assert not re.search(r"www\.|//|gh-\d", rest, re.IGNORECASE)
        assert all(line.isprintable() for line in got.split("\n"))
    fences = [markdown.render(one).splitlines().count("```") for one in (report, reports.hostile("plain"))]
    assert fences == [4, 4]
    table = [line for line in markdown.render(report).splitlines() if line.startswith("| ")]
    assert all(line.count("|") == 7 for line in table)


@given(st.text(st.characters(codec=None)))
@example("`")
@example(r"a\|b")
@example("@user #12 !3 https://x.y www.x.y a@b.cd deadbeef GH-12 :smile: %5 ~label")
def test_code_and_plain(nasty: str) -> None:
    for got in (markdown.code(nasty), markdown.plain(nasty)):
        assert not re.search(r"[|\n<>@#!\[\]`*_~&$:%]", _SPAN.sub("", got))
    assert markdown.plain("Toggle bit did not alternate (4.1.3), 5/6") == "Toggle bit did not alternate (4.1.3), 5/6"
    for linked in ("www.x", "a//b", "gh-12", "1234567", "@x", "- x", "# x"):
        assert markdown.plain(linked) == f"`{linked}`"


def test_annotations() -> None:
    got = github.commands(reports.faulty()).splitlines()
    assert (
        got[0].startswith(
            "::error title=FAIL::1 protocol error (ch6), 1 device error (ch5), 3 warnings, 1 note%0Ach6 node 25%3A A"
        )
        or got[0]
    )
    assert got[1] == (
        "::error title=TRF-003 ch6 node 25%3A A frame was lost or came out of order::"
        "lost frame: toggle 0 where 1 was due, 1 frame missing before 41658576 (3x, ESCStatus)"
        "%0Atailbyte decode crash.log --around 41658575+-50ms%0Atailbyte explain TRF-003"
    )
    assert [line.split(" ")[0] for line in got] == ["::error"] * 3 + ["::warning"] * 3 + ["::notice"]
    assert "commanded 100 %25, 0 rpm (1x)" in got[4]
    assert github.commands(reports.healthy()) == "::notice title=PASS::no findings\n"
    assert github.commands(reports.waived()).splitlines()[0].startswith("::error title=NOT JUDGED::1 warning, 1 waived")
    assert github.commands(reports.waived()).splitlines()[1] == "::error title=Requirement not met::8 ESCs: found 6"
    assert "TRF-003" not in github.commands(reports.waived())
    assert github.commands(reports.empty()) == "::error title=NOT JUDGED::no findings%0Anothing to judge\n"
    damaged = github.commands(reports.damaged()).splitlines()
    assert "::error title=Damaged capture::torn.mcap: ends inside chunk 7" in damaged
    assert any(line.startswith("::warning title=ERRORS NOT GATED%2C DAMAGED::") for line in damaged)


def test_ten_of_each_level() -> None:
    got = github.commands(reports.many()).splitlines()
    assert [sum(line.startswith(f"::{level} ") for line in got) for level in ("error", "warning", "notice")] == [
        10,
        10,
        10,
    ]
    assert all("TRF-003" in line for line in got[1:10]), "what fails the gate comes first"
    assert got[9].endswith("%0Aand 77 more, see the summary of this step")
    assert sum("more, see" in line for line in got) == 3


@given(TEXTS)
@example("".join(NASTY))
def test_workflow_commands_cannot_be_forged(nasty: str) -> None:
    for line in github.commands(reports.hostile(nasty)).split("\n")[:-1]:
        found = re.fullmatch(r"::(error|warning|notice) title=([^:,]*)::(.*)", line)
        assert found, line
        assert line.isprintable()
        assert not re.search(r"%(?!25|0A|3A|2C)", found[2])
        assert not re.search(r"%(?!25|0A)", found[3])
        assert "##[" not in line
