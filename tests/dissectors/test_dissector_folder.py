"""A vendor is a folder: one made outside the tree, with DSDL and a profile, decodes without a line of code."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.vendors import ACME, PART, PROFILE, PUMP, capture

import analyzer
import dissectors
from analyzer.app.capture import open_capture

if TYPE_CHECKING:
    from collections.abc import Callable


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    vendor = tmp_path / "vendor"
    (vendor / "acme" / "pump").mkdir(parents=True)
    (vendor / "profile.toml").write_text(PROFILE)
    (vendor / "acme" / "pump" / "20777.Pump.uavcan").write_text(PUMP)
    (vendor / "acme" / "pump" / "Part.uavcan").write_text(PART)
    return vendor


def check(rows: list[dict[str, Any]]) -> None:
    assert [row["pressure"] for row in rows] == pytest.approx([1.5, 1.51, 1.52])
    assert [row["state"] for row in rows] == [2, 2, 2]
    assert [row["temperature"] for row in rows] == [21.5] * 3
    assert [row["parts"] for row in rows] == [[{"number": n, "value": -n * k} for n in range(3)] for k in range(3)]
    assert {row["trusted"] for row in rows} == {True}


def signature_of(folder: Path) -> int:
    found = dissectors.load([folder]).signatures(0, ACME)[0]
    assert found is not None
    return found


def test_without_the_folder_nobody_knows_the_type(decode: Callable[..., Any], folder: Path) -> None:
    got = decode(capture(signature_of(folder)))
    assert {row["status"] for row in got.transfers if row["type_id"] == ACME} == {"unchecked"}
    assert set(got.messages) == {"RawCommand"}


def test_with_the_folder_it_decodes(decode: Callable[..., Any], folder: Path) -> None:
    got = decode(capture(signature_of(folder)), types=dissectors.load([folder]))
    assert {row["status"] for row in got.transfers} == {"ok"}
    check(got.messages["Pump"])
    assert len(got.messages["RawCommand"]) == 3


def test_an_array_in_the_last_element_of_an_array(
    decode: Callable[..., Any], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Elements below 8 bits keep the length in front, and then only the last one may leave out its own."""
    (folder / "acme" / "pump" / "20778.Log.uavcan").write_text("Entry[<=3] entries\n")
    (folder / "acme" / "pump" / "Entry.uavcan").write_text("uint3 level\nuint8[<=2] codes\n")
    types = dissectors.load([folder])
    message = types.message(0, 20778)
    assert message is not None
    monkeypatch.setitem(encode.RECORDS, "Entry", "level:u3 codes:u8[<2]")
    entries = [{"level": 5, "codes": [1]}, {"level": 2, "codes": [2, 3]}, {"level": 7, "codes": [9]}]
    for count in range(4):
        bits = encode.encode("entries:Entry[<3]", {"entries": entries[:count]}, tail=True)
        one = encode.Transfer("message", 20778, 42, encode.to_bytes(bits), message.signature)
        got = decode("".join(encode.log_line(frame) + "\n" for frame in one.frames()).encode(), types=types)
        (rows,) = got.messages.values()
        assert rows[0]["entries"] == entries[:count]


def test_units_and_enumerations_come_along(decode: Callable[..., Any], folder: Path) -> None:
    got = decode(capture(signature_of(folder)), types=dissectors.load([folder]))
    schema = next(batch.messages["Pump"].schema for batch in got.batches if "Pump" in batch.messages)
    assert schema.field("pressure").metadata[b"unit"] == b"bar"
    assert json.loads(schema.field("state").metadata[b"enum"]) == {"0": "idle", "2": "spinning"}


def test_through_the_public_door(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "pump.log"
    path.write_bytes(capture(signature_of(folder)))
    check(open_capture(path, dissectors=[folder]).table("Pump").to_pylist())
    with pytest.raises(LookupError):
        open_capture(path).table("Pump")


@pytest.mark.slow
def test_from_the_command_line(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "pump.log"
    path.write_bytes(capture(signature_of(folder)))
    code = "import sys; from analyzer.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", code, "decode", "-T", "jsonl", "--dissector", str(folder), str(path)]
    search = os.pathsep.join([str(Path(analyzer.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=tmp_path, env=os.environ | {"PYTHONPATH": search}
    )
    assert done.returncode == 0, done.stderr
    assert "tailbyte:" not in done.stderr
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    mine = [row for row in rows if row["type"] == "Pump"]
    assert len(rows) == 6
    assert [row["status"] for row in mine] == ["ok"] * 3
    assert [row["fields"]["state"] for row in mine] == [{"raw": 2, "text": "spinning"}] * 3
    assert [row["fields"]["parts"][2]["value"] for row in mine] == [0, -2, -4]


def test_a_folder_with_a_mistake_is_refused(folder: Path) -> None:
    (folder / "acme" / "pump" / "20777.Pump.uavcan").write_text("uint3 state\nuint99 pressure\n")
    with pytest.raises(dissectors.DsdlError, match="99"):
        dissectors.load([folder])


def test_a_field_may_be_called_like_a_column_of_every_message(tmp_path: Path, command: Callable[..., Any]) -> None:
    (tmp_path / "acme").mkdir()
    (tmp_path / "acme" / "20900.Pump.uavcan").write_text("uint8 t\nuint8 bus\nuint8 transfer\nuint8 trusted\n")
    log = tmp_path / "pump.log"
    log.write_text("".join(f"(1700000000.{k:06d}) can0 1051A407#01020304{0xC0 | k:02X}\n" for k in range(3)))
    sent = {"t": 1, "bus": 2, "transfer": 3, "trusted": 4}
    table = open_capture(log, [tmp_path / "acme"]).table("acme.Pump")
    assert table.column("transfer").to_pylist() == [0, 1, 2]
    assert {name: table.column(f"{name}.field").to_pylist() for name in sent} == {n: [v] * 3 for n, v in sent.items()}
    status, out, _ = command("decode", log, "--dissector", tmp_path / "acme", "-T", "jsonl")
    assert status == 0
    assert [json.loads(line)["fields"] for line in out.splitlines()] == [sent] * 3
    wanted = [word for name in sent for word in ("-e", f"Pump.{name}")]
    assert command("decode", log, "--dissector", tmp_path / "acme", "-T", "fields", *wanted)[1] == "1\t2\t3\t4\n" * 3
    assert "transfer: 3" in command("decode", log, "--dissector", tmp_path / "acme", "-V")[1]
    assert command("info", log, "--dissector", tmp_path / "acme")[0] == 0
