"""The report for people: what it says, that it fits, that nothing in a capture can fool a terminal."""

from __future__ import annotations

import re
import shlex
import subprocess
import time
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from kit import reports
from kit.reports import NASTY, TEXTS

from analyzer.report import github, junit, lines, markdown, text, wording
from analyzer.report.html import page as html
from analyzer.report.model import Gate, Requirement
from analyzer.report.problems import Problem, problems, ranked
from analyzer.views.terminal import Palette, display_width

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(autouse=True)
def in_utc(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def test_a_faulty_flight() -> None:
    got = text.render(reports.faulty()).splitlines()
    assert got[0].split("  ")[:2] == ["FAIL", "1 protocol error (ch6), 1 device error (ch5), 3 warnings, 1 note"]
    assert got[0].endswith("exit 1")
    heads = [line.split() for line in got if line[:1].isalpha()]
    assert [words[0] for words in heads] == [
        "FAIL", "PROTOCOL", "error", "DEVICE", "error", "warning", "warning", "PROTOCOL", "warning", "note",
        "CAPTURE", "note", "Rules", "Limits", "See:",
    ]  # fmt: skip
    at = next(k for k, line in enumerate(got) if "TRF-003" in line)
    assert got[at].startswith("error    TRF-003  ch6 node 25  A frame was lost")
    assert got[at].endswith("3x  12:49:55..58")
    assert "frames 41658575 41661020 41664811  clause 4.1.3 Toggle" in "\n".join(got[at:])
    assert "           tailbyte decode crash.log --around 41658575+-50ms" in got
    assert any(line.endswith("3x  08:02..10:02") for line in got), "runs of one problem are one line"
    assert "Limits used:  BUS-028 high_pct=10 zero_s=2.5  BUS-001 limit_per_s=2400" in got
    assert "note     error frames not recorded: CAN-004, BUS-005 INCONCLUSIVE" in got
    assert "Rules 10:  1 pass  2 fail  4 warn  1 not exercised  2 inconclusive" in got
    assert got[-1] == "See: tailbyte explain TRF-003 | check --all | --html FILE"


@pytest.mark.parametrize(
    ("name", "starts"),
    [
        ("healthy", "PASS  no findings"),
        ("empty", "NOT JUDGED  no findings"),
        ("damaged", "ERRORS NOT GATED, DAMAGED  1 capture error"),
        ("waived", "NOT JUDGED  1 warning, 1 waived"),
        ("compared", "FAIL  1 protocol error (ch5), 1 warning, 1 known"),
        ("two captures", "FAIL  2 protocol errors (ch5)"),
    ],
)
def test_the_answer_comes_first(name: str, starts: str) -> None:
    got = text.render(reports.SAMPLES[name]())
    assert got.startswith(starts)
    assert got.splitlines()[0].endswith(f"exit {reports.SAMPLES[name]().gate.exit_status}")


def test_what_is_excused_is_not_shown_but_counted() -> None:
    waived = text.render(reports.waived())
    assert "TRF-003" not in waived
    assert "Not shown: 1 waived (--all)" in waived
    assert "requires 8 ESCs:  NOT MET, found 6" in waived
    everything = text.render(reports.waived(), everything=True)
    assert "waived until 2026-12-31 by Ada: known since V2.2.05" in everything
    compared = text.render(reports.compared())
    assert "TYP-306" not in compared
    assert "new  clause" in compared
    assert "worse than before" in compared
    assert "Not shown: 1 known from the baseline (--all)" in compared


def test_damage_and_captures_are_told() -> None:
    assert "DAMAGED: ends inside chunk 7" in text.render(reports.damaged())
    assert "NOT ALL ACCOUNTED FOR" in text.render(reports.report(captures=(reports.capture(frames=7),)))
    both = text.render(reports.two_captures())
    assert "      2: second flight.log  can1" in both
    assert "tailbyte decode 'second flight.log' --around 1+-50ms" in both
    assert "ch5 node 24 can1 in 2" in both


def test_floods_are_cut_unless_all_is_wanted() -> None:
    report = reports.many()
    short, everything = text.render(report), text.render(report, everything=True)
    assert len(short.splitlines()) < 110
    assert "and 26 more of TRF-003: ch25 node 44," in short
    assert short.count("TRF-003  ") == 3
    assert sum(line.startswith(("error  ", "warning  ", "note  ")) for line in everything.splitlines()) == 201
    assert all(example.lines[0] in everything for one in report.findings for example in one.examples)


def test_most_rules_of_a_severity() -> None:
    rules = {f"TST-{k:03}": reports.TITLES["TRF-003"] for k in range(30)}
    found = [reports.replace(reports.finding("TRF-003"), rule=rule) for rule in rules]
    got = text.render(reports.report(*found))
    assert "TST-019" in got
    assert "TST-020" not in got
    assert "           and 10 more errors (--all)" in got


@pytest.mark.parametrize("name", reports.SAMPLES)
@pytest.mark.parametrize("width", [60, 80, 132, 200])
@pytest.mark.parametrize("everything", [False, True])
def test_it_fits(name: str, width: int, everything: bool) -> None:
    for line in text.render(reports.SAMPLES[name](), width=width, everything=everything).splitlines():
        assert display_width(line) <= width or line.lstrip().startswith(("tailbyte decode", "(")), line
        assert line == line.rstrip()


def test_a_wide_terminal_is_used() -> None:
    assert "clause 4.1.3 Toggle  tailbyte decode crash.log" in text.render(reports.faulty(), width=200)


def test_colours_change_nothing_else() -> None:
    painted = text.render(reports.faulty(), palette=Palette(on=True), everything=True)
    plain = text.render(reports.faulty(), everything=True)
    assert "\x1b[31mFAIL\x1b[0m" in painted
    assert "\x1b[31merror\x1b[0m    TRF-003" in painted
    for code in ("0", "1", "2", "31", "33", "36"):
        painted = painted.replace(f"\x1b[{code}m", "")
    assert painted == plain


@given(TEXTS)
@example("".join(NASTY))
def test_nothing_fools_a_terminal(nasty: str) -> None:
    report = reports.hostile(nasty)
    for everything in (False, True):
        got = text.render(report, everything=everything)
        assert got == text.render(report, everything=everything)
        assert all(line.isprintable() for line in got.split("\n"))
        assert "##[" not in got
        assert not re.search(r"^\s*::\w", got, re.MULTILINE)


@given(
    TEXTS.filter(
        lambda word: "\0" not in word and not any("\ud800" <= c < "\udc80" or "\udcff" < c <= "\udfff" for c in word)
    )
)
@example("a b$(ls)'\\`")
@example("x\udcffy\x1b#1##[x]")
def test_a_shell_reads_the_command_back(path: str) -> None:
    quoted = wording.quoted(path)
    assert quoted.isprintable()
    assert "##[" not in quoted
    got = subprocess.run(["bash", "-c", f"printf %s {quoted}"], capture_output=True, check=True).stdout
    assert got == path.encode("utf-8", "surrogateescape")


def test_commands() -> None:
    def shown(path: str = "a.log", **more: object) -> str:
        one = problems([reports.finding("TRF-003", **more)])[0]
        return wording.command(one, reports.capture(path=path, arguments=("--bus", "can0=a b")))

    assert shlex.split(shown()) == ["tailbyte", "decode", "a.log", "--bus", "can0=a b", "--around", "1+-50ms"]
    assert shown("-x").startswith("tailbyte decode ./-x ")
    assert shown(at=None, frame=3).endswith("--frames 1-8")
    assert shown(frame=None).endswith("--around 1773475330.600000000+-50ms")
    assert shown(at=None, frame=None) == "tailbyte info a.log --bus 'can0=a b'"
    assert wording.command(problems([reports.finding("TRF-003")])[0], None) == "tailbyte decode 1 --around 1+-50ms"


def test_times() -> None:
    second = reports.SECOND
    assert wording.moment(reports.START, None) == "08:02:10.600"
    assert wording.moment(12_345_678_901, 2_000_000_000) == "10.345 s"
    assert wording.moment(1 * second, 2 * second) == "-1.000 s"
    assert wording.moment(None, None) == "-"
    assert wording.full_moment(reports.START, None) == "2026-03-14 08:02:10.600 UTC"
    assert wording.full_moment(5 * second, 0) == "5.000 s"
    assert [wording.length(n) for n in (0, 59_999_000_000, 61 * second, 17_268 * second)] == [
        "0.000 s", "59.999 s", "1 min 1 s", "4 h 47 min",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("first", "last", "shows"),
    [(0, 0, "08:02:10.600"), (0, 100_000_000, "08:02:10.600"), (0, 5 * 10**9, "08:02:10..15"),
     (0, 60 * 10**9, "08:02:10..08:03:10"), (0, 7200 * 10**9, "08:02..10:02")],
)  # fmt: skip
def test_spans(first: int, last: int, shows: str) -> None:
    got = text.render(reports.report(reports.finding("TYP-305", first, last=last)))
    assert f"1x  {shows}\n" in got


def test_a_capture_of_days_and_one_without_dates() -> None:
    days = reports.capture(end_ns=reports.START + 90_000 * reports.SECOND)
    assert "1x  03-14 08:02:10.600\n" in text.render(reports.report(reports.finding("TYP-305"), captures=(days,)))
    timer = reports.capture(start_ns=10**9, end_ns=10**10)
    one = reports.finding("TYP-305", 2 * 10**9 - reports.START, last=10**9)
    assert "1x  1.000..2.000 s\n" in text.render(reports.report(one, captures=(timer,)))


def test_local_time_is_the_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "JST-9")
    time.tzset()
    report = reports.report(reports.finding("TYP-305"))
    assert "17:02:10.600" in text.render(report)
    assert "08:02:10.600" in text.render(report, utc=True)


def test_problems_are_runs_joined() -> None:
    worse = reports.finding("TRF-003", 9, frame=9, count=4, baseline="worse", frames=(9, 12))
    known = reports.finding("TRF-003", 3, frame=5, baseline="known", fails=False, frames=(5,))
    other = reports.finding("TRF-003", key="another")
    both, alone = problems([worse, known, other])
    assert (both.count, both.first.frame, both.last.frame, list(both.frames)) == (5, 5, 9, [5, 9, 12])
    assert (both.baseline, both.fails, both.open, both.waiver) == ("worse", True, True, None)
    assert alone.head is other
    assert not Problem((known,)).open
    long = reports.finding("TRF-003", frames=tuple(range(1, 31)), examples=worse.examples * 30)
    assert (len(Problem((long, known)).frames), len(Problem((long, known)).examples)) == (20, 20)
    note = Problem((reports.finding("CAN-013"),))
    assert ranked([note, Problem((known,)), both]) == [both, note, Problem((known,))]


def test_a_long_word_takes_no_time() -> None:
    assert len(lines.wrap("漢" * 200_000, 80)) == 5_000


@given(st.text("ab 漢\u0301", max_size=40), st.integers(10, 30))
@example("abcdefghijklmnopqrstuvwxyz", 10)
@example("a 漢漢漢漢漢漢", 10)
def test_wrapping_loses_nothing(words: str, width: int) -> None:
    got = lines.wrap(words, width, first="* ", indent="  ")
    assert all(display_width(line) <= width for line in got)
    assert "".join(line[2:] for line in got).replace(" ", "") == words.replace(" ", "")


def test_expectations_are_told_apart_from_requirements_in_every_format() -> None:
    needs = (
        Requirement("node 19", met=False, found="0 transfers", expected=True),
        Requirement("type Pump", met=True, found="9 transfers"),
    )
    gate = Gate(("protocol:error",), failed=True, judged=True, exit_status=1, reason="", requirements=needs)
    made = replace(reports.healthy(), gate=gate)
    assert text.render(made).startswith("FAIL  1 expectation not met")
    assert "expects node 19:  NOT MET, found 0 transfers" in text.render(made)
    assert "requires type Pump:  met, found 9 transfers" in text.render(made)
    assert "- expects node 19: **not met**, found 0 transfers" in markdown.render(made)
    assert "::error title=Expectation not met::node 19: found 0 transfers" in github.commands(made)
    assert 'name="expects 1 node 19"' in junit.render(made)
    assert "expected: node 19" in html.render(made)
    assert "1 expectation not met" in html.render(made)
