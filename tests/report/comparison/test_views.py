"""The views of differences: text at every width, JSON after its schema, HTML that a browser obeys in nothing."""

from __future__ import annotations

import json as plain_json
import re
from dataclasses import fields, replace
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any, get_args

import jsonschema
import pytest
from kit.reports import NASTY

import analyzer
from analyzer.report.comparison import html, json, limits, model
from analyzer.report.comparison.failing import CHOICES, DiffGate
from analyzer.report.comparison.rows import headline, rows
from analyzer.report.comparison.text import render
from analyzer.report.wording import quoted
from analyzer.views.terminal import display_width

if TYPE_CHECKING:
    from analyzer import CaptureDiff

SCHEMA = json.schema()
DEFS = {"side": model.Side, "difference": model.Difference, "compared": model.Compared, "matched": model.Matched}
T = 1_773_475_334_702_100_000


def side(path: str = "good.log", **more: Any) -> model.Side:
    usual = model.Side(path, "candump text", "ab" * 32, T - 5 * 10**9, T + 5 * 10**9, 100, 50, 0, ("can0",), 4,
                       {"timing": "yes", "errors": "no"})  # fmt: skip
    return replace(usual, **more)


def difference(**more: Any) -> model.Difference:
    usual = model.Difference("telemetry", "warning", "ch5", "can0", 24, "temperature at 58 %", "61 degC", "74 degC",
                             "likely", 1.6, 61.0, 74.0, "degC", 40, 50, "from", T,
                             command="tailbyte decode bad.log --around 1773475334.702+-1s")  # fmt: skip
    return replace(usual, **more)


def comparison(*found: model.Difference, **more: Any) -> CaptureDiff:
    usual = model.CaptureDiff("tailbyte 1", side(), side("bad.log"), found, (model.Compared("nodes", 4),),
                             ("error frames: not recorded in either capture",), (),
                             (model.Matched("can0", 24, "can0", 25, "unique ID"),), limits.limits())  # fmt: skip
    return replace(usual, **more)


def many() -> CaptureDiff:
    found = [difference(node=k, who=f"ch{k}", what=f"thing {k % 7}", weight=model.WEIGHTS[k // 40]) for k in range(120)]
    return comparison(*found)


def hostile() -> CaptureDiff:
    nasty = " ".join(NASTY)
    bad = difference(
        who=nasty,
        bus=nasty,
        what=nasty,
        good=nasty,
        bad=nasty,
        remark=nasty,
        command=f"tailbyte decode {quoted(nasty)}",
    )
    return comparison(bad, difference(kind="finding", rule=nasty, node=None, who=""),
                      good=side(nasty, damage=nasty, form=nasty), remarks=(nasty,), cannot=(nasty,),
                      matched=(model.Matched(nasty, 1, nasty, 2, "node ID"),))  # fmt: skip


SAMPLES = {
    "equal": comparison(),
    "one": comparison(difference()),
    "note": comparison(difference(weight="note", t_ns=None, since="", command="")),
    "many": many(),
    "hostile": hostile(),
    "nothing": comparison(good=side(transfers=0), compared=()),
    "no times": comparison(
        difference(t_ns=None, since="throughout", command=""), bad=side("b", start_ns=None, end_ns=None)
    ),
}  # fmt: skip


# ---- text ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SAMPLES)
@pytest.mark.parametrize("width", [40, 80, 120])
@pytest.mark.parametrize("everything", [False, True])
def test_lines_fit(name: str, width: int, *, everything: bool) -> None:
    text = render(SAMPLES[name], width=width, everything=everything)
    long = [line for line in text.splitlines() if display_width(line) > width]
    assert all("tailbyte decode" in line or name == "hostile" for line in long)
    assert all(line.isprintable() or not line for line in text.splitlines())
    assert text == render(SAMPLES[name], width=width, everything=everything)


@pytest.mark.parametrize("name", SAMPLES)
def test_one_screen(name: str) -> None:
    shown = render(SAMPLES[name], height=23).splitlines()
    assert len(shown) <= 23 or len(rows(SAMPLES[name].differences)) <= 2


def test_the_screen() -> None:
    assert render(SAMPLES["one"], utc=True) == (
        "DIFFERENT  1 warning\n"
        "good     good.log  2026-03-14 08:02:09  10.000 s  4 nodes\n"
        "bad      bad.log  2026-03-14 08:02:09  10.000 s  4 nodes\n"
        "first    08:02:14.702  ch5 node 24: temperature at 58 %\n"
        "         Who          What                        Good     Bad      Since\n"
        "warning  ch5 node 24  temperature at 58 %         61 degC  74 degC  08:02:14.702\n"
        "         likely  40 and 50 reports\n"
        "         tailbyte decode bad.log --around 1773475334.702+-1s\n"
        "\n"
        "Compared 4 nodes\n"
        "Cannot   error frames: not recorded in either capture\n"
    )


def test_verdicts() -> None:
    assert [headline(SAMPLES[name])[0] for name in ("equal", "one", "note", "nothing")] == [
        "NO DIFFERENCE FOUND", "DIFFERENT", "ALIKE", "NOT COMPARED",
    ]  # fmt: skip


def test_what_is_left_out_is_counted() -> None:
    text = render(SAMPLES["many"])
    (line,) = (line for line in text.splitlines() if line.endswith("(--all)"))
    shown = sum(line.startswith(model.WEIGHTS) for line in text.splitlines())
    assert int(line.split()[1]) + shown == len(rows(SAMPLES["many"].differences))
    whole = render(SAMPLES["many"], everything=True)
    assert sum(line.startswith(model.WEIGHTS) for line in whole.splitlines()) == 120


def test_one_difference_of_many_nodes_is_a_row() -> None:
    alike = [difference(node=k, who=f"ch{k}", kind="firmware", what="software") for k in range(1, 9)]
    (row,) = rows(alike)
    assert (row.who, len(row.members), row.more) == ("ch1 ch2 ch3 ch4 +4", 8, "")
    (row,) = rows([difference(node=k, who=f"ch{k}", kind="node", good=f"{k} Hz", bad="not there") for k in (1, 2, 3)])
    assert (row.who, row.more) == ("ch1 ch2 ch3", "values of ch1 node 1")
    assert len(rows([*alike[:2]])) == 2
    assert len(rows([*alike, replace(alike[0], node=20, who="ch20", bad="another")])) == 2
    assert len(rows(alike, everything=True)) == 8


def test_a_row_names_other_rules_only() -> None:
    alike = [difference(kind="finding", rule=rule, what=rule) for rule in ("TRF-003", "TRF-003", "TRF-006", "TRF-006")]
    assert [row.more for row in (rows(alike)[0], rows(alike[:2])[0])] == ["also TRF-006", ""]


# ---- JSON ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "of"), [*DEFS.items(), ("", model.CaptureDiff)])
def test_the_schema_names_what_the_model_has(name: str, of: Any) -> None:
    part = SCHEMA["$defs"][name] if name else SCHEMA
    assert set(part["properties"]) == set(part["required"]) == {field.name for field in fields(of)}
    assert part["description"]


@pytest.mark.parametrize(("name", "of"), [("weight", model.Weight), ("kind", model.Kind), ("support", model.Support)])
def test_the_schema_lists_the_choices(name: str, of: Any) -> None:
    assert set(SCHEMA["$defs"][name]["enum"]) == set(get_args(of))


@pytest.mark.parametrize("name", SAMPLES)
def test_samples_are_valid(name: str) -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    content = plain_json.loads(json.render(SAMPLES[name]))
    jsonschema.Draft202012Validator(SCHEMA).validate(content)
    assert next(iter(content)) == "schema"
    if name != "hostile":
        assert content == plain_json.loads(plain_json.dumps(SAMPLES[name].as_json()))


# ---- HTML ------------------------------------------------------------------------------------------------------------


class Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.seen: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))


@pytest.mark.parametrize("name", SAMPLES)
def test_a_page_loads_and_runs_nothing(name: str) -> None:
    page = html.render(SAMPLES[name])
    tags = Tags()
    tags.feed(page)
    names = {tag for tag, _ in tags.seen}
    assert not names & {"script", "img", "iframe", "object", "embed", "base", "form"}
    assert [tag for tag, _ in tags.seen].count("style") == 1
    assert all(key not in ("style", "src", "onerror", "onclick") for _, attributes in tags.seen for key in attributes)
    assert {attributes["href"][:1] for tag, attributes in tags.seen if tag == "a"} == {"#"}
    policy = next(attributes["content"] for tag, attributes in tags.seen if "http-equiv" in attributes)
    assert policy.startswith("default-src 'none'; style-src 'sha256-")
    assert page == html.render(SAMPLES[name])


def test_a_page_says_what_the_text_says() -> None:
    page = html.render(SAMPLES["one"])
    for text in ("DIFFERENT", "temperature at 58 %", "61 degC", "74 degC", "--around 1773475334.702+-1s", "likely"):
        assert text in page.replace("&#43;", "+")
    assert "No difference found" in html.render(SAMPLES["equal"])


# ---- the rest --------------------------------------------------------------------------------------------------------


def test_each_limit_has_an_origin() -> None:
    for name, one in limits.table().items():
        assert {*one} == {"value", "about", "origin"}, name
        assert len(one["origin"]) > 10
        assert one["value"] >= 0
    source = "".join(path.read_text() for path in _modules())
    unused = [name for name in limits.limits() if f'"{name}"' not in source and not re.search(r"_least$", name)]
    assert {*unused} <= {"rpm", "current", "voltage", "temperature", "reported"}


def _modules() -> list[Any]:
    from pathlib import Path  # noqa: PLC0415 - of this test alone

    return [*Path(analyzer.__file__).parent.glob("report/comparison/**/*.py")]


@pytest.mark.parametrize(
    ("names", "weight", "fails"),
    [("any", "note", True), ("error", "warning", False), ("warning", "error", True), ("note", "note", True),
     ("telemetry", "note", True), ("rate,loss", "error", False), ("never", "error", False)],
)  # fmt: skip
def test_what_fails(names: str, weight: model.Weight, *, fails: bool) -> None:
    assert DiffGate.parse([names]).fails(difference(weight=weight)) is fails


def test_a_gate_refuses_other_words() -> None:
    with pytest.raises(ValueError, match=", ".join(CHOICES)):
        DiffGate.parse(["errors"])
    with pytest.raises(ValueError, match="nothing else"):
        DiffGate.parse(["never,any"])
