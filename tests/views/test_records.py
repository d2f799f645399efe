"""`-T jsonl|json|csv|fields`: what programs read must be what was sent."""

from __future__ import annotations

import csv
import io
import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import VECTORS, encode
from kit.strategies import examples, fields_of
from kit.traffic import START, lines, push, same, status, throttle

from analyzer.views.fields import Fields, field_names
from analyzer.views.frames.window import FrameWindow
from analyzer.views.records import KEYS, Csv, JsonArray, JsonLines
from analyzer.window.listed import ListedRows

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors import Registry

GOLDEN = ("tm_golden", "tm_golden_fd", "neighbours")


def vectors(name: str) -> list[dict[str, Any]]:
    return json.loads((VECTORS / f"{name}.json").read_text())


def only(*transfers: int) -> ListedRows:
    none = np.zeros(0, np.int64)
    return ListedRows(np.array(transfers, np.int64), none, none, none)


def written(view: Any, got: Any, picked: Any = None) -> str:
    body = [text for batch in got.batches for text in view.rows(batch, picked)]
    return view.begin() + "".join(body) + view.end()


def jsonl(got: Any, registry: Registry) -> list[dict[str, Any]]:
    return [json.loads(line) for line in written(JsonLines(registry), got).splitlines()]


def bare(value: Any) -> Any:
    """Without the objects that name values and bits: raw numbers only."""
    if isinstance(value, list):
        return [bare(cell) for cell in value]
    if isinstance(value, dict):
        return bare(value["raw"]) if "raw" in value else {key: bare(inner) for key, inner in value.items()}
    return value


def exact(value: Any) -> Any:
    """As text, so that 1, 1.0, -0.0 and true differ."""
    return json.dumps(value, sort_keys=True)


@pytest.fixture(scope="module")
def golden(decode: Callable[..., Any], registry: Registry) -> dict[str, dict[int, dict[str, Any]]]:
    """Records by file and number of their first frame, which is their line."""
    found = {name: jsonl(decode((VECTORS / f"{name}.log").read_bytes()), registry) for name in GOLDEN}
    return {name: {record["frame"]: record for record in some} for name, some in found.items()}


@pytest.mark.parametrize(("file", "at"), [(name, k) for name in GOLDEN for k in range(len(vectors(name)))])
def test_golden(golden: dict[str, dict[int, dict[str, Any]]], file: str, at: int) -> None:
    vector = vectors(file)[at]
    record = golden[file][vector["frames"][0]["line"]]
    assert tuple(record) == KEYS
    sent = {key: value for key, value in vector["fields"].items() if not key.endswith("__raw16")}
    assert list(record["fields"]) == list(sent)
    assert exact(bare(record["fields"])) == exact(sent)
    assert record["frames"] == [frame["line"] for frame in vector["frames"]]
    assert record["payload"] == vector["payload"]
    assert (record["type"], record["type_id"]) == (vector.get("type", vector["dsdl"]), vector["dtid"])
    assert (record["src"], record["dst"], record["status"]) == (vector["source"], vector.get("dest"), "ok")
    assert record["transfer_id"] == vector["transfer_id"]
    crc = vector.get("transfer_crc")
    if "type" in vector:
        assert record["crc_wire"] == record["crc_here"] == (crc and crc[2:].zfill(4))
    assert (record["packets"] is None) == (vector.get("type") not in ("PUSHSCI", "PUSHCAN"))


def test_kinds_and_absent_values(golden: dict[str, dict[int, dict[str, Any]]]) -> None:
    found = {r["type"] + " " + r["kind"]: r for r in golden["neighbours"].values()}
    assert {name.rpartition(" ")[2] for name in found} == {"message", "request", "response", "anonymous"}
    anonymous = found["uavcan.protocol.dynamic_node_id.Allocation anonymous"]
    assert (anonymous["src"], anonymous["dst"], anonymous["crc_wire"], anonymous["crc_here"]) == (0, None, None, None)
    assert found["uavcan.protocol.param.GetSet response"]["fields"]["value"] == {"integer_value": 3}
    assert found["uavcan.protocol.NodeStatus message"]["t_ns"] == 1_700_001_000_000_000_000


def test_named_values_and_bit_parts(golden: dict[str, dict[int, dict[str, Any]]]) -> None:
    by_name = {v["name"]: golden["tm_golden"][v["frames"][0]["line"]]["fields"] for v in vectors("tm_golden")}
    fields = by_name["typical_permanent"]
    assert fields["esc_signal_priority"] == {"raw": 1, "text": "CAN"}
    assert fields["esc_led_mode"] == {"raw": 407, "enable": 7, "flash": False, "frequency": 2.5}
    assert fields["esc_uuid"] == 305419896
    assert by_name["query_all_0xFF"]["esc_uuid"] == 4294967295
    cruise = by_name["cruise"]["error_count"]
    assert cruise["raw"] == 536821760
    assert (cruise["mode"], cruise["stall"]) == ({"raw": 4, "text": "operating"}, False)
    assert cruise["encoder"] == 8191 * 360 / 16384
    # 4.4.3 gives modes 1 to 8 only.
    assert by_name["rpm_max"]["error_count"]["mode"] == {"raw": 15, "text": None}


def test_packets_are_physical(golden: dict[str, dict[int, dict[str, Any]]]) -> None:
    by_name = {v["name"]: golden["tm_golden"][v["frames"][0]["line"]]["packets"] for v in vectors("tm_golden")}
    (motor,) = by_name["status_0x15_running"]
    assert (motor["type"], motor["ok"]) == ("MotorStatus", True)
    assert {k: motor["fields"][k] for k in ("position", "voltage", "current", "speed", "temperature")} == {
        "position": 180.0, "voltage": 50.2, "current": 12.5, "speed": 3200, "temperature": 45.12,
    }  # fmt: skip
    assert motor["fields"]["system_status"] == {"raw": 0, "text": "no rotor lock"}
    assert motor["fields"]["fault"]["stall"] is False
    (feedback,) = by_name["foc_param_feedback_0x1E"]
    assert feedback["fields"]["software_version"] == "SW-V2.2.3"
    (query,) = by_name["foc_query_0x1A_all_units"]
    assert query["fields"]["unit_id"] == 255
    assert by_name["empty_data"] == []
    assert by_name["one_byte"] == [{"type": None, "ok": False, "fields": {"reason": "no header", "data": "7B"}}]
    (damaged,) = by_name["max_255_bytes"]
    assert damaged["ok"] is False


def test_broken_and_unknown_transfers(decode: Callable[..., Any], registry: Registry) -> None:
    lost = status(1).frames()
    flipped = push(1).frames()
    flipped[2] = encode.Frame(flipped[2].id, bytes([flipped[2].data[0] ^ 1]) + flipped[2].data[1:])
    unknown = [encode.Transfer("message", 20710, 10, b"\xab\xcd", 0, k).frames() for k in range(4)]
    got = decode(lines(status(0).frames(), lost[:1], lost[2:], push(0).frames(), flipped, *unknown))
    found = jsonl(got, registry)
    by_status = {
        name: [r for r in found if r["status"] == name] for name in ("ok", "interrupted", "bad crc", "unchecked")
    }
    (cut,) = by_status["interrupted"]
    assert (cut["type"], cut["fields"], cut["packets"]) == ("ESCStatus", None, None)
    (bad,) = by_status["bad crc"]
    assert bad["crc_wire"] != bad["crc_here"]
    assert bad["fields"]["data_sequence"] == 1
    assert isinstance(bad["packets"], list)
    assert len(by_status["unchecked"]) == 4
    assert {(r["type"], r["type_id"], r["payload"]) for r in by_status["unchecked"]} == {(None, 20710, "ABCD")}
    assert all(r["fields"] is None for r in by_status["unchecked"])


def test_time_that_was_not_recorded_is_null(decode: Callable[..., Any], registry: Registry) -> None:
    (record,) = jsonl(decode(lines(throttle(0).frames(), timed=False)), registry)
    assert record["t_ns"] is None


def test_padding_is_stripped_only_where_it_is_padding(decode: Callable[..., Any], registry: Registry) -> None:
    sent = throttle(0, fd=True)
    (frame,) = sent.frames()
    assert len(frame.data) - 1 > len(sent.payload)
    dirty = encode.Frame(frame.id, frame.data[:-2] + b"\x01\xc1", fd=True)
    found = jsonl(decode(lines([frame], [dirty])), registry)
    assert [r["payload"] for r in found] == [sent.payload.hex().upper(), dirty.data[:-1].hex().upper()]
    # On classic CAN a byte too many is no padding.
    long = encode.Frame(0x1F044C01, b"\x01\x00\xc0")
    assert [r["payload"] for r in jsonl(decode(lines([long])), registry)] == ["0100"]


def test_json_is_one_array_also_when_empty(decode: Callable[..., Any], registry: Registry) -> None:
    got = decode(lines(throttle(0).frames(), throttle(1).frames()))
    assert json.loads(written(JsonArray(registry), got)) == jsonl(got, registry)
    assert json.loads(written(JsonArray(registry), got, only())) == []
    assert json.loads(written(JsonArray(registry), decode(b""))) == []


def test_picked_rows_come_in_the_order_given(decode: Callable[..., Any], registry: Registry) -> None:
    got = decode(lines(*(throttle(k, k).frames() for k in range(5)), push(0).frames()))
    found = [json.loads(line) for line in written(JsonLines(registry), got, only(5, 3, 1)).splitlines()]
    assert [r["type"] for r in found] == ["PUSHCAN", "RawCommand", "RawCommand"]
    assert [r["fields"]["cmd"][0] for r in found[1:]] == [3, 1]
    assert found[0]["packets"][0]["fields"]["data"] == bytes(range(25)).hex().upper()


def test_csv_survives_a_spreadsheet(decode: Callable[..., Any], registry: Registry) -> None:
    text = lines(throttle(0).frames(), status(0).frames()).replace(b" can0 ", b' =cmd|"a",1 ', 1)
    got = decode(text)
    rows = list(csv.DictReader(io.StringIO(written(Csv(registry), got), newline="")))
    expected = jsonl(got, registry)
    assert [row["bus"] for row in rows] == ["'" + expected[0]["bus"], "can0"]
    for row, record in zip(rows, expected, strict=True):
        assert tuple(row) == KEYS
        assert json.loads(row["fields"]) == record["fields"]
        assert row["frames"].split() == [str(n) for n in record["frames"]]
        assert (row["dst"], row["t_ns"]) == ("", str(record["t_ns"]))
    assert written(Csv(registry), got).count("\r\n") == 3


def test_hostile_bus_names_stay_inside_their_value(decode: Callable[..., Any], registry: Registry) -> None:
    got = decode(lines(throttle(0).frames()).replace(b" can0 ", b" c\x1b[2J\xe2\x80\xaea "))
    if not got.transfers:  # such a line may also count as unreadable
        assert len(got.events) == 1
        return
    text = written(JsonLines(registry), got)
    assert text.isascii()
    assert text[:-1].isprintable()


@pytest.fixture(scope="module")
def flight(decode: Callable[..., Any]) -> Any:
    return decode((VECTORS / "tm_golden.log").read_bytes())


def column(got: Any, registry: Registry, *names: str, picked: Any = None) -> list[list[str]]:
    window = FrameWindow()
    view = Fields(registry, names, window)
    out = []
    for batch in got.batches:
        window.feed(batch)
        out += [line.rstrip("\n").split("\t") for line in view.rows(batch, picked)]
    return out


def test_fields(flight: Any, registry: Registry) -> None:
    names = [
        "frame.number", "dronecan.type", "ESCStatus.status.mode", "uavcan.equipment.esc.Status.voltage",
        "PUSHCAN.MotorStatus.voltage", "RawCommand.cmd", "PUSHCAN.FocFeedback.software_version.text", "can.len",
        "can.flags.xtd",
    ]  # fmt: skip
    found = {row[0]: row[1:] for row in column(flight, registry, *names)}
    assert found["9"][:5] == ["RawCommand", "", "", "", "8191,0,8191,0,-8192,1,-1,4095"]
    assert found["9"][6:] == ["8,8,3", "1"]
    assert found["57"][:3] == ["ESCStatus", "4", "48.5"]
    assert found["72"][2] == "NaN"
    assert found["150"][3] == "50.2"
    assert found["160"][5] == "SW-V2.2.3"


def test_fields_of_frames_and_times(decode: Callable[..., Any], registry: Registry) -> None:
    got = decode(lines(throttle(0).frames(), status(0).frames()))
    names = ("frame.time_epoch", "frame.time_relative", "frame.time_delta", "frame.interface_name", "can.id",
             "dronecan.src", "dronecan.dst", "dronecan.kind", "dronecan.status")  # fmt: skip
    first, second = column(got, registry, *names)
    assert first == [
        "1700000000.001000000",
        "0.000000000",
        "0.000000000",
        "can0",
        str(0x1F040601),
        "1",
        "",
        "message",
        "ok",
    ]
    assert second[1:3] == ["0.001000000", "0.001000000"]
    assert column(got, registry, "frame.time_delta", picked=only(1)) == [["0.001000000"]]
    assert START == 1_700_000_000 * 10**9


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("ESCStatus.voltag", "ESCStatus.voltage"),
        ("frame.nmuber", "frame.number"),
        ("PUSHCAN.MotorStatus.sped", "PUSHCAN.MotorStatus.speed"),
        ("ESCStatus.status.stal", "ESCStatus.status.stall"),
        ("MotorStatus.speed", "it may be any of PUSH"),
    ],
)
def test_unknown_fields_are_told_with_near_ones(registry: Registry, name: str, near: str) -> None:
    with pytest.raises(ValueError, match=near.replace(".", r"\.")):
        Fields(registry, [name], lambda _: None)


@pytest.mark.slow
def test_every_listed_name_is_accepted(registry: Registry) -> None:
    names = list(field_names(registry))
    assert len(names) == len(set(names)) > 900
    Fields(registry, names, lambda _: None)
    assert {"frame.number", "ESCStatus.error_count.mode", "PUSHCAN.MotorStatus.speed"} <= set(names)


@examples(60)
@given(data=st.data())
def test_any_message_comes_out_as_it_was_sent(
    decode: Callable[..., Any], registry: Registry, data: st.DataObject
) -> None:
    name = data.draw(st.sampled_from(sorted(encode.TYPES)))
    fields = data.draw(fields_of(name))
    more = {"dst": 9} if encode.TYPES[name].kind != "message" else {}
    sent = encode.transfer(name, fields, 10, fd=data.draw(st.booleans()), **more)
    (record,) = jsonl(decode(lines(sent.frames())), registry)
    assert same(fields, bare(record["fields"]))
    assert bytes.fromhex(record["payload"]) == sent.payload


def test_no_float_is_lost_on_the_way() -> None:
    code = np.arange(65536, dtype=np.uint16).view(np.float16).astype(np.float32).tolist()
    finite = [value for value in code if math.isfinite(value)]
    assert json.loads(json.dumps(finite)) == finite


def test_scaled_numbers_are_raw_again(decode: Callable[..., Any], registry: Registry) -> None:
    """Latitudes are tables of degrees, but 1e-8 of a degree is what was sent."""
    zero = next(v for k, v in encode.TYPES.items() if k.endswith("Fix2"))
    raw = [29 * k + 57 for k in range(60)]
    empty = {"timestamp": {"usec": 0}, "gnss_timestamp": {"usec": 0}, "ned_velocity": [0.0] * 3, "covariance": [],
             "ecef_position_velocity": []}  # fmt: skip
    names = [word.split(":")[0] for word in zero.layout.split() if word.split(":")[0]]
    fields = dict.fromkeys(names, 0) | empty
    sent = [encode.transfer(zero.name, fields | {"latitude_deg_1e8": v}, 10, k).frames() for k, v in enumerate(raw)]
    found = jsonl(decode(lines(*sent)), registry)
    assert [r["fields"]["latitude_deg_1e8"] for r in found] == raw
