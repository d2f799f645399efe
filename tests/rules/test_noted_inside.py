"""What the notes of a dissector allow is judged wherever the field is: in structures, their lists, unions, services."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.traffic import MS, START

import analyzer
import dissectors

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

FILES = {
    "State.uavcan": "uint16 pressure\nuint8 code\nfloat32 flow\nuint8 word\n",
    "20900.Pump.uavcan": "State state\nState[<=3] several\n",
    "20901.Unit.uavcan": "uint8 mode\nuint16 value\nbool valve\nvoid7\nuint8 bus\n",
    "20902.Any.uavcan": "@union\nuint8 small\nuint16 large\n",
    "200.Ask.uavcan": "uint8 state\n---\nuint8 state\nfloat16 flow\n",
}
PROFILE = """\
tree = "."
[type."acme.State".field]
pressure = { unit = "bar", scale = "1/10", high = 150 }
code = { enum = { 0 = "idle", 1 = "run" }, special = { 255 = "unknown" } }
flow = { low = 0.1, high = 20 }
word = { bits = { stall = 7, mode = { at = "0-3", enum = { 0 = "a", 3 = "b" } } } }
[message."acme.Unit".field]
valve = { enum = { 0 = "shut" } }
bus = { high = 3 }
value.unit_by.mode = { 0 = { unit = "A", scale = 0.1, high = 150 }, 1 = { unit = "V" } }
[message."acme.Any".field]
small = { high = 9 }
large = { high = 150 }
[request."acme.Ask".field]
state = { high = 3 }
[response."acme.Ask".field]
state = { enum = { 0 = "ok" } }
flow = { low = 0, high = 10 }
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    space = tmp_path / "acme" / "acme"
    space.mkdir(parents=True)
    for name, text in FILES.items():
        (space / name).write_text(text)
    (tmp_path / "acme" / "profile.toml").write_text(PROFILE)
    return tmp_path / "acme"


def state(pressure: int = 150, code: int = 1, flow: float = 0.1, word: int = 0x80) -> bytes:
    return struct.pack("<HBfB", pressure, code, flow, word)


def unit(mode: int = 0, value: int = 150, *, valve: bool = False, bus: int = 3) -> bytes:
    return struct.pack("<BHBB", mode, value, valve << 7, bus)


def log(folder: Path, name: str, body: bytes, kind: str, **more: Any) -> Path:
    """Thirty transfers, a tenth of a second apart; a response follows its request."""
    of = dissectors.load([folder]).resolve(name)
    lines: list[str] = []
    for k in range(30):
        if kind == "response":
            asked = encode.Transfer("request", of.type_id, 9, b"\1", of.signature, k, dst=20)
            lines += [encode.log_line(frame) + "\n" for frame in asked.frames(START + k * 100 * MS - MS)]
        sent = encode.Transfer(kind, of.type_id, 20, body, of.signature, k, **more)
        lines += [encode.log_line(frame) + "\n" for frame in sent.frames(START + k * 100 * MS)]
    path = folder.parent / "pump.log"
    path.write_text("".join(lines))
    return path


def told(folder: Path, name: str, body: bytes, kind: str = "message", **more: Any) -> list[str]:
    report = analyzer.check(log(folder, name, body, kind, **more), dissectors_=[folder])
    found = [one for one in report.findings if one.rule in ("TYP-013", "TYP-014")]
    assert {(one.count, one.severity) for one in found} <= {(30, "warning")}
    return sorted(f"{one.rule} {one.text}" for one in found)


@pytest.mark.parametrize(
    ("body", "found"),
    [
        (state() + state() * 3, []),
        (state(code=255) + state(word=0x03), []),
        (state(151) + state(), ["TYP-013 state.pressure = 15.1 bar, at most 15 allowed"]),
        (state(code=7), ["TYP-014 state.code = 7, named are 0 idle, 1 run"]),
        (state(flow=99.0), ["TYP-013 state.flow = 99, 0.1 to 20 allowed"]),
        (state(word=0x81), ["TYP-014 state.word.mode = 1, named are 0 a, 3 b"]),
        (state() + state() + state(299), ["TYP-013 several.pressure = 29.9 bar, at most 15 allowed"]),
        (state() + state(code=7) + state(code=8), ["TYP-014 several.code = 7, named are 0 idle, 1 run"]),
        (state() + state(flow=0.05), ["TYP-013 several.flow = 0.05, 0.1 to 20 allowed"]),
        (state() + state() * 2 + state(word=5), ["TYP-014 several.word.mode = 5, named are 0 a, 3 b"]),
    ],
)
def test_in_structures_and_lists_of_them(folder: Path, body: bytes, found: list[str]) -> None:
    assert told(folder, "Pump", body) == found


@pytest.mark.parametrize(
    ("body", "found"),
    [
        (unit(), []),
        (unit(value=151), ["TYP-013 value = 15.1 A, at most 15 allowed"]),
        (unit(1, value=999), []),
        (unit(valve=True), ["TYP-014 valve = 1, named are 0 shut"]),
        (unit(bus=4), ["TYP-013 bus = 4, at most 3 allowed"]),
    ],
)
def test_what_follows_another_field_and_what_is_called_like_a_column(
    folder: Path, body: bytes, found: list[str]
) -> None:
    assert told(folder, "Unit", body) == found


@pytest.mark.parametrize(
    ("name", "body", "kind", "found"),
    [
        ("Any", encode.pack((0, 1), (9, 8)), "message", []),
        ("Any", encode.pack((0, 1), (99, 8)), "message", ["TYP-013 small = 99, at most 9 allowed"]),
        ("Any", encode.pack((1, 1), (299, 16)), "message", ["TYP-013 large = 299, at most 150 allowed"]),
        ("Ask.Request", b"\4", "request", ["TYP-013 state = 4, at most 3 allowed"]),
        ("Ask.Response", b"\0" + struct.pack("<e", 10), "response", []),
        ("Ask.Response", b"\2" + struct.pack("<e", 12), "response",
         ["TYP-013 flow = 12, 0 to 10 allowed", "TYP-014 state = 2, named are 0 ok"]),
    ],
)  # fmt: skip
def test_in_unions_and_services(folder: Path, name: str, body: bytes, kind: str, found: list[str]) -> None:
    more = {} if kind == "message" else {"dst": 9}
    assert told(folder, name, body, kind, **more) == found


def test_a_scaled_member_is_shown_in_its_unit(folder: Path, command: Callable[..., tuple[int, str, str]]) -> None:
    path = log(folder, "Pump", state(299) + state(15), "message")
    given = (str(path), "--dissector", str(folder), "--frames", "1-3")
    _, out, _ = command("decode", *given, "-V")
    assert "pressure: 29.9 bar (raw 299)" in out
    assert "pressure: 1.5 bar (raw 15)" in out
    _, out, _ = command("decode", *given, "-T", "fields", "-e", "Pump.state.pressure", "-e", "Pump.several.pressure")
    assert out.splitlines()[0] == "29.9\t1.5"
    _, out, _ = command("decode", *given, "-T", "jsonl")
    assert '"state":{"pressure":299,' in out  # fields of messages are raw
