"""The JSON report against its schema, and the schema against the model."""

from __future__ import annotations

import json as plain_json
import math
from dataclasses import fields, replace
from typing import Any, get_args

import jsonschema
import pytest
from hypothesis import example, given
from kit import reports
from kit.reports import NASTY, TEXTS

from analyzer.report import json, model

SCHEMA = json.schema()
DEFS = {
    "place": model.Place, "example": model.Example, "waiver": model.Waiver, "finding": model.Finding,
    "ruleVerdict": model.RuleVerdict, "bus": model.BusUse, "node": model.NodeUse, "capture": model.CaptureSummary,
    "coverage": model.Coverage, "requirement": model.Requirement, "gate": model.Gate, "waiverUse": model.WaiverUse,
    "deviceEvent": model.DeviceEvent,
}  # fmt: skip


def validate(text: str) -> Any:
    content = plain_json.loads(text)
    jsonschema.Draft202012Validator(SCHEMA).validate(content)
    return content


def test_the_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert SCHEMA["properties"]["schema"]["const"] == model.SCHEMA


@pytest.mark.parametrize(("name", "of"), [*DEFS.items(), ("", model.Report)])
def test_the_schema_names_what_the_model_has(name: str, of: Any) -> None:
    part = SCHEMA["$defs"][name] if name else SCHEMA
    names = {field.name for field in fields(of)} - set(model.NOT_IN_JSON)
    assert set(part["properties"]) == set(part["required"]) == names
    assert part["description"]


@pytest.mark.parametrize(
    ("name", "of"),
    [("severity", model.Severity), ("category", model.Category), ("origin", model.Origin), ("verdict", model.Verdict)],
)
def test_the_schema_lists_the_choices(name: str, of: Any) -> None:
    assert set(SCHEMA["$defs"][name]["enum"]) == set(get_args(of))


@pytest.mark.parametrize("name", reports.SAMPLES)
def test_samples_are_valid(name: str) -> None:
    report = reports.SAMPLES[name]()
    content = validate(json.render(report))
    assert next(iter(content)) == "schema"
    assert content == plain_json.loads(plain_json.dumps(report.as_json()))
    assert json.render(report) == json.render(reports.SAMPLES[name]())


@pytest.mark.parametrize(
    ("part", "wrong"),
    [("frames", [0]), ("frames", list(range(1, 22))), ("severity", "fatal"), ("node", 128), ("count", 0),
     ("node", "24"), ("waiver", {}), ("baseline", None), ("first", {"frame": 1})],
)  # fmt: skip
def test_the_schema_refuses(part: str, wrong: object) -> None:
    content = plain_json.loads(json.render(reports.faulty()))
    content["findings"][0][part] = wrong
    assert not jsonschema.Draft202012Validator(SCHEMA).is_valid(content)
    del content["findings"][0][part]
    assert not jsonschema.Draft202012Validator(SCHEMA).is_valid(content)


def test_a_finding_is_a_line() -> None:
    got = json.render(reports.many()).splitlines()
    assert sum(line.startswith('  {"rule"') and '"first"' in line for line in got) == 200
    assert json.render(reports.empty()).count('"findings": []') == 1


def test_no_number_that_json_has_not() -> None:
    (of,) = reports.faulty().captures
    bus = replace(of.buses[0], mean=math.nan, load=(math.inf, 0.5))
    content = validate(json.render(reports.report(captures=(replace(of, buses=(bus,)),))))
    assert (content["captures"][0]["buses"][0]["mean"], content["captures"][0]["buses"][0]["load"]) == (
        None,
        [None, 0.5],
    )


@given(TEXTS)
@example("".join(NASTY))
def test_hostile_texts(nasty: str) -> None:
    text = json.render(reports.hostile(nasty))
    assert text.isascii()
    content = validate(text)
    content["findings"][0]["text"].encode()  # no lone surrogate is left
    if not any("\ud800" <= c <= "\udfff" for c in nasty):
        assert content["findings"][0]["text"] == nasty
        assert content["captures"][0]["path"] == nasty


def test_bytes_that_are_no_text() -> None:
    content = validate(json.render(reports.hostile("a\udcffb\ud83d")))
    assert content["captures"][0]["path"] == r"a\xffb\ud83d"
