"""`--derived`: units, computed values and names of special values in records for programs."""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING, Any

import pytest
from kit import VECTORS, encode
from kit.flight import OPEN
from kit.traffic import MS, START, TURNING, capture, motor
from kit.vendors import SPACE

from analyzer.views.records import DERIVED, KEYS, JsonLines

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dissectors import Registry

    Command = Callable[..., tuple[int, str, str]]


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    path = tmp_path / "flight.log"
    hot = encode.transfer(f"{SPACE}StatusMsg2", {"input_voltage": 502, "current": -3, "temperature": 43}, 12)
    path.write_text(
        capture([
            (0, 11, "ESCStatus", TURNING | {"temperature": 300.0}),
            (10, 1, "RawCommand", {"cmd": [-8191, 8191]}),
            (20, 125, "ParamCfg", OPEN | {"esc_timing": 20}),
            (30, 11, "PUSHCAN", motor(0, pwm=0)),
            (40, 125, "PUSHSCI", encode.packet("PUSHSCI.FocQuery", 0, 0xFF)),
        ])
        + "".join(encode.log_line(frame) + "\n" for frame in hot.frames(START + 60 * MS))
    )  # fmt: skip
    return path


def read(command: Command, path: Path, *options: str) -> list[dict[str, Any]]:
    status, out, _ = command("decode", str(path), *options)
    assert status == 0
    return [json.loads(line) for line in out.splitlines()]


def test_on_request_only(flight: Path, command: Command) -> None:
    plain, more = read(command, flight, "-T", "jsonl"), read(command, flight, "-T", "jsonl", "--derived")
    assert all(tuple(record) == KEYS for record in plain)
    assert all(tuple(record) == (*KEYS, *DERIVED) for record in more)
    for record in more:
        for packet in (record, *(record["packets"] or ())):
            for key in DERIVED:
                del packet[key]
    assert more == plain
    named = read(command, flight, "-T", "jsonl", "--derived", "--findings")
    assert all(tuple(record) == (*KEYS, *DERIVED, "findings") for record in named)


def test_units_and_values(flight: Path, command: Command) -> None:
    status, throttle, settings, pushed, query, other = read(command, flight, "-T", "jsonl", "--derived")
    assert status["derived"] == {"temperature_celsius": pytest.approx(26.85), "channel": 1.0}
    assert status["units"] == {
        "voltage": "V", "current": "A", "rpm": "rpm", "power_rating_pct": "%", "error_count.encoder": "deg",
        "temperature_celsius": "degC",
    }  # fmt: skip
    assert throttle["derived"] == {
        "percent": [-100, 100], "pulse_uav_us": [None, 1940], "pulse_spraying_us": [None, 1950],
    }  # fmt: skip
    assert settings["texts"]["esc_id_set"] == settings["texts"]["esc_led_mode"] == "no change"
    assert "esc_timing" not in settings["texts"]
    assert settings["units"]["esc_timing"] == "deg"
    (packet,) = pushed["packets"]
    assert (packet["fields"]["voltage"], packet["units"]["voltage"]) == (48.5, "V")
    assert packet["derived"] == {"runtime.unwrapped": 0, "unit": 1.0, "temperature_celsius": 41.0}
    assert packet["texts"] == {"pwm": "no signal"}
    (packet,) = query["packets"]
    assert (packet["derived"], packet["texts"]) == ({"unit": None}, {"unit_id": "all", "unit": "all"})
    # What is raw among the fields is in its unit among the derived values.
    assert other["fields"] == {"input_voltage": 502, "current": -3, "temperature": 43}
    assert other["derived"] == {"input_voltage": 50.2, "current": -0.3}
    assert other["units"] == {"input_voltage": "V", "current": "A", "temperature": "degC"}


@pytest.mark.parametrize("name", ["tm_golden", "tm_golden_fd", "neighbours", "violations"])
def test_every_type_has_them(decode: Callable[..., Any], registry: Registry, name: str) -> None:
    got = decode((VECTORS / f"{name}.log").read_bytes())
    for batch in got.batches:
        for record in map(json.loads, JsonLines(registry, derived=True).rows(batch)):
            assert (record["derived"] is None) == (record["fields"] is None)


def test_other_forms(flight: Path, command: Command) -> None:
    wanted = read(command, flight, "-T", "jsonl", "--derived")
    assert json.loads(command("decode", str(flight), "-T", "json", "--derived")[1]) == wanted
    rows = list(csv.DictReader(io.StringIO(command("decode", str(flight), "-T", "csv", "--derived")[1], newline="")))
    for row, record in zip(rows, wanted, strict=True):
        assert tuple(row) == (*KEYS, *DERIVED)
        assert [json.loads(row[key]) for key in DERIVED] == [record[key] for key in DERIVED]


@pytest.mark.parametrize(
    "options", [[], ["-T", "fields", "-e", "frame.number"], ["-T", "jsonl", "--frame-list"], ["-V"]]
)
def test_where_it_says_nothing_new(flight: Path, command: Command, options: list[str]) -> None:
    status, out, err = command("decode", str(flight), "--derived", *options)
    assert (status, out) == (2, "")
    assert "--derived is for -T jsonl, json and csv" in err
