"""Columns without a capture, and captures of which only some tables are wanted."""

from __future__ import annotations

import io
import pickle
from pathlib import Path

import pytest

import analyzer

HOVER = "captures/hover.log"


@pytest.mark.parametrize(
    "name", ["frames", "transfers", "events", "findings", "esc", "ESCStatus", "PUSHCAN.MotorStatus"]
)
def test_a_table_has_its_columns_without_a_capture(name):
    assert analyzer.schema(name) == analyzer.open_capture(HOVER).table(name).schema


def test_a_table_that_no_type_has():
    with pytest.raises(LookupError, match="ESCStatus"):
        analyzer.schema("ESCStatsu")


def test_only_the_tables_and_columns_that_are_wanted():
    capture = analyzer.open_capture(HOVER, tables=["ESCStatus"], columns=["t", "voltage"])
    whole = analyzer.open_capture(HOVER).table("ESCStatus")
    found = [batch.messages for batch in pickle.loads(pickle.dumps(capture))]
    assert {name for messages in found for name in messages} == {"ESCStatus"}
    assert sum(len(messages["ESCStatus"]) for messages in found if messages) == len(whole)
    assert capture.table("ESCStatus").equals(whole.select(["t", "voltage"]))


@pytest.mark.parametrize("wrong", [{"tables": ["Nope"]}, {"tables": ["ESCStatus"], "columns": ["volts"]}])
def test_wishes_that_cannot_be_met(wrong):
    with pytest.raises(LookupError):
        analyzer.open_capture(HOVER, **wrong)


def test_errors_of_captures_cross_processes():
    for kind in (analyzer.CaptureError, analyzer.UnavailableError):
        error = pickle.loads(pickle.dumps(kind("a.log", "byte 7", "torn")))
        assert (type(error), error.name, error.place, error.reason) == (kind, "a.log", "byte 7", "torn")


def test_a_stream_gives_what_the_file_gives():
    stream = io.BytesIO(Path(HOVER).read_bytes())
    stream.name = "s3://bucket/hover.log"
    assert analyzer.open_capture(stream).table("ESCStatus") == analyzer.open_capture(HOVER).table("ESCStatus")
