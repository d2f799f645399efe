"""Values that are no numbers ("no change", "all"), and numbers that have no meaning: said alike in every view."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.flight import OPEN
from kit.traffic import capture, throttle
from pyarrow import parquet

import analyzer

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

QUERY = "PUSHSCI.FocQuery"
PARAM_GET = {
    **OPEN, "esc_id_req": 0x00FF, "esc_startup_times": 0, "esc_startup_duration": 0, "esc_product_date": 0,
    "esc_error_count": 0, "rsvd": [],
}  # fmt: skip
del PARAM_GET["esc_id_set"]


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    """Settings that change nothing, an answer to all, reverse throttle, packets for unit 1, for all and for none."""
    path = tmp_path / "flight.log"
    path.write_text(
        capture([
            (0, 125, "ParamCfg", OPEN),
            (10, 11, "ParamGet", PARAM_GET),
            (20, 1, "RawCommand", {"cmd": [-8191, 0, 8191]}),
            (30, 125, "PUSHSCI", encode.packet("PUSHSCI.FocQuery", 0, 0xA1)),
            (40, 125, "PUSHSCI", encode.packet("PUSHSCI.FocQuery", 1, 0xFF)),
            (50, 125, "PUSHSCI", encode.packet("PUSHSCI.FocParameters", 2, 0xAA, led=0xFFFF, throttle_priority=0xFFFF)),
        ])
    )  # fmt: skip
    return path


def test_table(flight: Path) -> None:
    capture_ = analyzer.open_capture(flight)
    (settings,), (packet,) = (capture_.table(name).to_pylist() for name in ("ParamCfg", "PUSHSCI.FocParameters"))
    assert (settings["esc_led_mode"], packet["led"]) == (0xFFFF, 0xFFFF)
    parts = ("enable", "flash", "frequency")
    assert [settings[f"esc_led_mode.{part}"] for part in parts] == [None] * 3
    assert [packet[f"led.{part}"] for part in parts] == [None] * 3
    assert [packet[f"throttle_priority.{part}"] for part in ("priority", "position_loop")] == [None] * 2
    (command,) = capture_.table("RawCommand").to_pylist()
    assert command["percent"] == [-100, 0, 100]
    assert command["pulse_uav_us"] == [None, 1040, 1940]
    assert command["pulse_spraying_us"] == [None, 1050, 1950]
    assert [row["unit"] for row in capture_.table("PUSHSCI.FocQuery").to_pylist()] == [1, None]


def test_list(flight: Path, command: Command) -> None:
    _, out, _ = command("decode", str(flight))
    settings, answer, _, one, everyone, packet = (line[48:] for line in out.splitlines()[1:])
    assert settings.startswith("index all uuid all")
    assert "ID all" in answer
    assert one.startswith("FocQuery unit 1 query FOC parameters")
    assert everyone.startswith("FocQuery unit all query FOC parameters")
    assert packet.startswith("FocParameters unit 0xAA: ")  # a unit that there is not


def test_details(flight: Path, command: Command) -> None:
    _, out, _ = command("decode", str(flight), "-V")
    lines = [" ".join(line.split()) for line in out.splitlines()]
    led = next(k for k, line in enumerate(lines) if line.startswith("esc_led_mode: 65535 (no change)"))
    assert lines[led + 1].startswith("esc_can_rate")
    assert any(line.startswith("esc_id_set: 65535 (no change)") for line in lines)
    assert any(line.startswith("esc_id_req: 255 (all)") for line in lines)
    assert [line.partition(",")[0] for line in lines if line.startswith("[unit:")] == [
        "[unit: 1", "[unit: all", "[unit: 0xAA"
    ]  # fmt: skip
    assert any(line.startswith("[pulse_uav_us: - 1040 1940 us, from cmd]") for line in lines)


def test_records(flight: Path, command: Command) -> None:
    _, out, _ = command("decode", str(flight), "-T", "jsonl")
    found: list[dict[str, Any]] = [json.loads(line) for line in out.splitlines()]
    nothing = {"enable": None, "flash": None, "frequency": None}
    assert found[0]["fields"]["esc_led_mode"] == {"raw": 0xFFFF, **nothing, "text": "no change"}
    assert found[-1]["packets"][0]["fields"]["led"] == {"raw": 0xFFFF, **nothing, "text": "no change"}
    names = ["ParamCfg.esc_led_mode.frequency", "RawCommand.pulse_uav_us", "PUSHSCI.FocQuery.unit"]
    _, out, _ = command("decode", str(flight), "-T", "fields", *(word for name in names for word in ("-e", name)))
    rows = [line.split("\t") for line in out.splitlines()]
    assert [row[0] for row in rows] == [""] * 6
    assert rows[2][1] == ",1040.0,1940.0"
    assert [row[2] for row in rows[3:5]] == ["1.0", ""]


def test_export(flight: Path, tmp_path: Path, command: Command) -> None:
    assert command("export", str(flight), "-o", str(tmp_path / "out"), "--format", "parquet")[0] == 0
    names = ("ParamCfg", "ParamGet", QUERY)
    tables = {name: parquet.read_table(tmp_path / "out" / f"{name}.parquet") for name in names}
    (settings,) = tables["ParamCfg"].to_pylist()
    assert settings["esc_led_mode.frequency"] is None
    assert tables[QUERY].column("unit").to_pylist() == [1, None]
    texts = {("ParamCfg", "esc_id_set"): {"65535": "no change"}, (QUERY, "unit_id"): {"255": "all"}}
    texts["ParamGet", "esc_id_req"] = {"255": "all", "65535": "all"}
    for (table, column), wanted in texts.items():
        assert json.loads(tables[table].schema.field(column).metadata[b"enum"]) == wanted


def test_negative_throttle_of_one_channel_leaves_the_others(decode: Callable[..., Any]) -> None:
    got = decode("".join(encode.log_line(frame) + "\n" for frame in throttle(0, -1).frames()).encode())
    (row,) = got.messages["RawCommand"]
    assert row["pulse_uav_us"] == [None] * 4
