"""The HTML report: complete, self-contained, the same each time, and deaf to whatever a capture says."""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import html_samples as samples
from kit.reports import START
from kit.strategies import examples

from analyzer.report.html import render
from analyzer.report.html.evidence import frame_line
from analyzer.report.html.svg import course
from analyzer.report.model import Place
from analyzer.report.moments import Span, clock, moment
from dissectors.times import SECOND

VOID = {"meta", "br", "input", "img"}


class Page(HTMLParser):
    """A page as a browser would take it apart; complains of what does not nest."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self._open: list[str] = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert len(dict(attrs)) == len(attrs), tag
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID and not (self.get_starttag_text() or "").endswith("/>"):
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self._open[-1:] not in (["style"], ["script"]):
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def faulty() -> Page:
    return Page(render(samples.faulty()))


def test_it_says_what_matters(faulty: Page) -> None:
    for said in (
        "FAIL", "exit status 1", "TRF-003 is at or above protocol:error", "crash flight 3.log", "20 min 0 s",
        "drops unknown", "errors no", "60 s with motors running", "the last line is cut",
        "frame 2 of 3 is missing: toggle 0 where 1 was due", "ch6 node 25", "1380921, 1380950, 1381002",
        "52 AE 2B 4C 4D 00 00 29 toggle 1 ID 9", "9C 1E 04 10 FC 0C 46 89 start toggle 0 ID 9",
        "limit 2,400/s, motors turn", "limit 4,000/s, motors rest", "above the limit: motors turn",
        "known cable, replaced in May (j.doe, until 2026-06-30)", "tailbyte explain TRF-003",
        "tailbyte decode 'crash flight 3.log' --around 1380921+-50ms", "NOT EXERCISED 6", "error frames not recorded",
        "2.1 shape of the connector", "BUS-002 limit_per_s 4000", "3 unreadable", "balanced", "no candump line",
        "18FEF100 [4] FF FF FF FF",
    ):  # fmt: skip
        assert said in faulty.text, said
    assert "NOT BALANCED" not in faulty.text


def test_a_clean_capture_passes() -> None:
    page = Page(render(samples.healthy()))
    assert "PASS no findings" in page.text
    assert "no rule was broken" in page.text
    assert [of for of in page.all("details") if "finding" in str(of["class"])] == []


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"failed": False, "judged": False, "exit_status": 4}, "NOT JUDGED, DAMAGED"),
        ({"failed": False, "exit_status": 0}, "ERRORS NOT GATED, DAMAGED"),
        ({}, "FAIL, DAMAGED"),
    ],
)
def test_the_word_on_top(changes: dict[str, object], word: str) -> None:
    report = samples.faulty()
    text = render(replace(report, gate=replace(report.gate, **changes)))  # type: ignore[arg-type]
    assert f'<span class="word">{word}</span>' in text


def test_a_sum_that_does_not_come_out_is_said() -> None:
    report = samples.healthy()
    wrong = replace(report.captures[0], verdicts={"used": 1})
    assert "NOT BALANCED" in Page(render(replace(report, captures=(wrong,)))).text


def test_nothing_comes_from_elsewhere(faulty: Page) -> None:
    for _, attributes in faulty.tags:
        assert not {"src", "srcset", "action", "style", "data", "background", "poster"} & attributes.keys()
        assert not [name for name in attributes if name.startswith("on")]
        assert (attributes.get("href") or "#").startswith("#")
    assert faulty.all("link") == faulty.all("img") == faulty.all("base") == []
    text = render(samples.faulty())
    assert not re.search(r"https?:|url\(|@import", text)


def test_the_policy_allows_this_style_and_this_script_only(faulty: Page) -> None:
    text = render(samples.faulty())
    policy = faulty.all("meta")[1]["content"]
    hashes = {}
    for tag in ("style", "script"):
        (body,) = re.findall(rf"<{tag}>(.*?)</{tag}>", text, re.DOTALL)
        hashes[tag] = base64.b64encode(hashlib.sha256(body.encode()).digest()).decode()
    assert policy == (
        f"default-src 'none'; style-src 'sha256-{hashes['style']}'; script-src 'sha256-{hashes['script']}'; "
        "base-uri 'none'; form-action 'none'"
    )


def test_links_lead_somewhere_and_names_are_unique(faulty: Page) -> None:
    ids = [of["id"] for _, of in faulty.tags if "id" in of]
    assert len(ids) == len(set(ids))
    for attributes in faulty.all("a"):
        assert str(attributes["href"])[1:] in ids
    for _, attributes in faulty.tags:
        assert attributes.get("aria-labelledby", ids[0]) in ids


def test_it_is_accessible(faulty: Page) -> None:
    assert faulty.all("html") == [{"lang": "en"}]
    assert len(faulty.all("h1")) == 1
    levels = [int(tag[1]) for tag, _ in faulty.tags if re.fullmatch("h[1-6]", tag)]
    assert all(after <= before + 1 for before, after in pairwise(levels) if before > 1)
    assert all("scope" in of for of in faulty.all("th"))
    for of in faulty.all("svg"):
        assert of.get("role") or of.get("aria-hidden") or "viewbox" in of
    assert len(faulty.all("title")) > len([of for of in faulty.all("svg") if of.get("role") == "img"])


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_have_contrast(scheme: str) -> None:
    css = re.findall(r":root \{(.*?)\}", render(samples.healthy()), re.DOTALL)[scheme == "dark"]
    colours = {
        name: value if len(value) == 7 else "#" + "".join(c * 2 for c in value[1:])
        for name, value in re.findall(r"--([\w-]+): (#\w+);", css)
    }
    pairs = [
        (of, well) for of in ("ink", "soft", "link", "error", "warning", "crc", "tail") for well in ("card", "page")
    ]
    pairs += [(of, f"{of}-well") for of in ("error", "warning", "note", "pass")]
    for front, back in pairs:
        assert contrast(colours[front], colours[back]) >= 4.5, (front, back)


def contrast(one: str, other: str) -> float:
    low, high = sorted(map(luminance, (one, other)))
    return (high + 0.05) / (low + 0.05)


def luminance(colour: str) -> float:
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_same_input_same_bytes() -> None:
    assert render(samples.faulty()) == render(samples.faulty())


def harmless(text: str) -> None:
    written = render(samples.hostile(text))
    written.encode()
    assert all(c == "\n" or c.isprintable() for c in written.replace("\xa0", ""))
    page = Page(written)
    assert len(page.all("script")) == len(page.all("style")) == 1
    assert {tag for tag, _ in page.tags} <= {tag for tag, _ in Page(render(samples.hostile("plain"))).tags}
    for _, attributes in page.tags:
        assert not [name for name in attributes if name.startswith("on")]
        assert (attributes.get("href") or "#").startswith("#")


@pytest.mark.sampled(2)
@pytest.mark.parametrize("text", samples.HOSTILE, ids=range(len(samples.HOSTILE)))
def test_hostile_texts_are_harmless(text: str) -> None:
    harmless(text)


@pytest.mark.slow
@given(st.text(st.characters(), max_size=80) | st.text("<>&'\"{}%#/=\x00\x1b\u202e\u2028", max_size=40))
@examples(60)
def test_any_text_is_harmless(text: str) -> None:
    harmless(text)


def test_a_hostile_name_changes_no_tag() -> None:
    shapes = [
        [(tag, sorted(attributes)) for tag, attributes in Page(render(samples.hostile(text))).tags]
        for text in ("<b/onclick=x>", "plain")
    ]
    assert shapes[0] == shapes[1]


def test_long_names_are_cut() -> None:
    written = render(samples.hostile("x" * 10_000))
    assert "x" * 401 not in written
    assert "x" * 59 + "…" in written


@pytest.mark.slow
def test_many_findings_stay_small() -> None:
    written = render(samples.long())
    assert len(written.encode()) < 10_000_000
    assert written.count('<details class="finding') == 5000
    assert "left out" not in written


@pytest.mark.slow
def test_too_many_findings_are_counted() -> None:
    written = render(samples.long(9000, "<" * 900))
    assert len(written.encode()) < 10_000_000
    shown = written.count('<details class="finding')
    assert f"{9000 - shown:,} more findings are left out" in written
    assert shown > 1000


@pytest.mark.slow
def test_rows_of_endless_tables_are_bounded() -> None:
    report = samples.faulty()
    of = report.captures[0]
    names = {f"type {k}": 1 for k in range(5000)}
    nodes = tuple(replace(of.nodes[1], node=k % 127 + 1, types=names) for k in range(2000))
    crowd = replace(
        report,
        captures=(replace(of, nodes=nodes, buses=of.buses * 100),),
        coverage=replace(report.coverage, types=names, values={"field": names}),
        settings={"limits": {f"R-{k}": {"x": k} for k in range(5000)}},
    )
    written = render(crowd)
    assert "1,500 more nodes are not listed" in written
    assert len(written.encode()) < 3_000_000


@pytest.mark.parametrize("t", [None, 0, -5, 1 << 63, -(1 << 63), 10**25])
def test_any_time_can_be_shown(t: int | None) -> None:
    report = samples.faulty()
    found = replace(report.findings[0], first=Place(None, t), last=Place(None, t))
    capture = replace(report.captures[0], start_ns=t, end_ns=t)
    assert "No frame" not in Page(render(replace(report, findings=(found,), captures=(capture,)))).text


def test_times_are_cut_and_in_utc() -> None:
    assert moment(START + 23_456_789) == "2026-03-14 08:02:10.623456"
    assert (clock(START + 399_999_999), clock(1_500_000_000), clock(-1_500_000_000, 1)) == (
        "08:02:10.999", "1.500 s", "-1.5 s",
    )  # fmt: skip


@given(st.integers(0, 1 << 62), st.integers(0, 1 << 61))
def test_ticks_lie_inside_and_are_few(start: int, length: int) -> None:
    ticks = Span(start, start + length).ticks()
    assert len(ticks) <= 8
    assert all(0 <= at <= 100 for at, _ in ticks)


@given(st.lists(st.floats(0, 1e9), max_size=1200))
def test_a_course_shows_the_peak_and_no_more_points_than_fit(values: list[float]) -> None:
    drawn = course(values, Span(0, SECOND), 0, SECOND, title="<t>")
    assert "&lt;t&gt;" in drawn
    (peak,) = re.findall(r'class="peak" d="([^"]*)"', drawn)
    heights = [float(y) for y in re.findall(r"[ML][\d.]+ (-?[\d.]+)H", peak)]
    assert len(heights) == min(len(values), 500)
    if max(values, default=0) > 1e-3:
        assert min(heights) == pytest.approx(100 - 100 / 1.12, abs=0.06)


def test_one_busy_second_among_thousands_is_seen() -> None:
    drawn = course([0.0] * 4001 + [9.0] + [0.0] * 4000, Span(0, SECOND), 0, SECOND, title="")
    assert len(re.findall(r" 10\.7H", drawn)) == 1


def test_a_frame_is_taken_apart() -> None:
    first, last, foreign, raw = map(
        frame_line, (samples.LINES[0], samples.LINES[2], "(1.0) can0 123#0102", "(1.0) can0 123#R")
    )
    assert (first.crc, first.payload, first.tail) == ("9C 1E", "04 10 FC 0C 46", "89")
    assert first.words == "start toggle 0 ID 9"
    assert (last.crc, last.payload, last.tail, last.length) == ("", "00 00", "49", "[3]")
    assert (foreign.id, foreign.payload, foreign.words) == ("123", "01 02", "")
    assert (raw.raw, raw.id) == ("(1.0) can0 123#R", "")
    assert frame_line("(1.0) can0 1F040A18##1" + "00" * 64).length == "FD [64]"
    assert frame_line(samples.LINES[0], dronecan=False).payload == "9C 1E 04 10 FC 0C 46 89"
