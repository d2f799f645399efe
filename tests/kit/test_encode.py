"""The independent sender against the golden vectors and against pydronecan: it must be right before it may judge."""

from __future__ import annotations

import json

import dronecan
import pytest
from dronecan.transport import Transfer
from hypothesis import given
from hypothesis import strategies as st

from kit import VECTORS, encode, strategies
from kit.strategies import examples

FULL_NAMES = {
    "ESCStatus": "uavcan.equipment.esc.Status",
    "RawCommand": "uavcan.equipment.esc.RawCommand",
    **{name: f"com.tmotor.esc.{name}" for name in ("ParamCfg", "ParamGet", "PUSHSCI", "PUSHCAN")},
}
PYDRONECAN_FD_BUG = {62, 123, 186, 249}  # pydronecan makes frames of 63 bytes for these payload lengths


def golden() -> list[object]:
    cases = []
    for name in ("tm_golden", "tm_golden_fd", "neighbours"):
        lines = (VECTORS / f"{name}.log").read_text().splitlines()
        cases += [
            pytest.param(v, lines, id=f"{name}-{v['name']}") for v in json.loads((VECTORS / f"{name}.json").read_text())
        ]
    return cases


def vector_fields(fields: dict) -> dict:
    raw = {k.removesuffix("__raw16"): encode.Code(int(v, 16)) for k, v in fields.items() if k.endswith("__raw16")}
    return {k: v for k, v in fields.items() if not k.endswith("__raw16")} | raw


def vector_name(vector: dict) -> str:
    if "type" in vector:
        return vector["type"]
    part = ("", ".Request" if vector.get("request") else ".Response")[vector["service"]]
    return vector["dsdl"] + part


@pytest.mark.parametrize(("vector", "lines"), golden())
def test_golden_frames(vector: dict, lines: list[str]) -> None:
    sent = encode.transfer(
        vector_name(vector),
        vector_fields(vector["fields"]),
        vector["source"],
        vector["transfer_id"],
        priority=int(vector["frames"][0]["id"], 16) >> 24,
        dst=vector.get("dest"),
        fd=vector.get("canfd", False),
        **({"kind": "anonymous"} if vector["source"] == 0 else {}),
    )
    assert sent.payload.hex().upper() == vector["payload"]
    if "transfer_crc" in vector:
        assert sent.crc == (vector["transfer_crc"] and int(vector["transfer_crc"], 16))
    frames = sent.frames()
    assert [(f"{f.id:08X}", f.data.hex().upper()) for f in frames] == [(f["id"], f["data"]) for f in vector["frames"]]
    for frame, wanted in zip(frames, vector["frames"], strict=True):
        line = lines[wanted["line"] - 1]
        assert encode.log_line(frame).split(") ")[1] == line.split(") ")[1]


def test_golden_counts() -> None:
    assert [len(json.loads((VECTORS / f"{n}.json").read_text())) for n in ("tm_golden", "tm_golden_fd")] == [48, 48]


def test_crc_check_value_of_the_document() -> None:
    assert encode.crc16(b"123456789") == 0x29B1  # 5.1


@pytest.mark.parametrize("name", sorted(encode.TYPES))
def test_signature_is_pydronecans(name: str) -> None:
    of, base = encode.TYPES[name], name.removesuffix(".Request").removesuffix(".Response")
    known = dronecan.TYPENAMES[FULL_NAMES.get(base, base)]
    assert (of.type_id, of.signature) == (known.default_dtid, known.get_data_type_signature())


def fill(target: object, fields: dict) -> None:
    """Put plain values into a pydronecan structure; reading a member of a union is what selects it there."""
    for name, value in fields.items():
        if isinstance(value, dict):
            fill(getattr(target, name), value)
        elif isinstance(value, list):
            array = getattr(target, name)
            array.clear()
            for item in value:
                new = array.new_item() if isinstance(item, dict) else item
                if isinstance(item, dict):
                    fill(new, item)
                array.append(new)
        else:
            setattr(target, name, value)


def pydronecan_frames(sent: encode.Transfer, name: str, fields: dict) -> list[tuple[int, bytes]]:
    base = name.removesuffix(".Request").removesuffix(".Response")
    known = dronecan.TYPENAMES[FULL_NAMES.get(base, base)]
    service = sent.kind in ("request", "response")
    message = getattr(known, sent.kind.capitalize())() if service else known()
    fill(message, fields)
    theirs = Transfer(
        payload=message,
        source_node_id=sent.src,
        dest_node_id=sent.dst,
        transfer_id=sent.transfer_id,
        transfer_priority=sent.priority,
        request_not_response=sent.kind == "request",
        service_not_message=service,
        discriminator=(sent.can_id >> 10 & 0x3FFF) if sent.kind == "anonymous" else None,
        canfd=sent.fd,
    )
    return [(f.message_id, bytes(f.bytes)) for f in theirs.to_frames()]


@examples(400)
@given(st.data(), st.sampled_from(sorted(encode.TYPES)), st.booleans(), st.integers(0, 31), st.integers(0, 31))
def test_frames_are_pydronecans(data: st.DataObject, name: str, fd: bool, transfer_id: int, priority: int) -> None:
    fields = data.draw(strategies.fields_of(name, finite=True))
    of = encode.TYPES[name]
    service = of.kind != "message"
    sent = encode.transfer(name, fields, 10, transfer_id, fd=fd, priority=priority, dst=20 if service else None)
    if fd and len(sent.payload) in PYDRONECAN_FD_BUG:
        assert all(len(f.data) in encode.DLC_LENGTHS for f in sent.frames())
        return
    assert [(f.id, f.data) for f in sent.frames()] == pydronecan_frames(sent, name, fields)


@examples(50)
@given(strategies.fields_of("uavcan.protocol.dynamic_node_id.Allocation", finite=True))
def test_anonymous_frames_are_pydronecans(fields: dict) -> None:
    name = "uavcan.protocol.dynamic_node_id.Allocation"
    fields = fields | {"unique_id": fields["unique_id"][:6]}
    sent = encode.transfer(name, fields, 0, kind="anonymous")
    assert [(f.id, f.data) for f in sent.frames()] == pydronecan_frames(sent, name, fields)


SHARED = "acceleration_limit=4000 deceleration_limit=4000 throttle_priority=1 led=407 report_rate=100 save_option=1"
THRESHOLDS = "over_voltage_threshold=600 over_current_threshold=120 over_temperature_threshold=110"
SETTINGS = f"esc_id=1 {THRESHOLDS} beep_volume=50 {SHARED}"
RUNNING = "position=18000 pwm=14400 throttle=125 speed=3200 voltage=5020 current=1250 temperature=4512"
PACKETS = {  # golden vector: packet, frame count, unit, last byte of the checksum, values
    "zero_position_0x08": ("PUSHSCI.SetZero", 1, 0xA1, None, ""),
    "foc_param_set_0x1E_sum_1_30": ("PUSHSCI.FocParameters", 2, 0xA1, None, SETTINGS),
    "foc_param_set_0x1E_sum_1_28": ("PUSHSCI.FocParameters", 3, 0xA1, 28, SETTINGS),
    "foc_query_0x1A_all_units": ("PUSHSCI.FocQuery", 4, 0xFF, None, ""),
    "controller_output_0x06_speed_loop": ("PUSHSCI.OutputControl", 5, 0xA3, None, "control_mode=0x33 set_point=4500"),
    "controller_output_0x06_query": ("PUSHSCI.OutputControl", 6, 0xA9, None, ""),
    "status_0x15_running": ("PUSHCAN.MotorStatus", 1, 0xA1, None, RUNNING + " power_on_count=321 runtime=5400"),
    "foc_param_feedback_0x1E": ("PUSHCAN.FocFeedback", 7, 0xA2, None, SHARED + " position_loop=1"),
}


@pytest.mark.parametrize("vector", sorted(PACKETS))
def test_packets_of_the_golden_vectors(vector: str) -> None:
    name, count, unit, end, values = PACKETS[vector]
    known = {key: int(value, 0) for key, value in (word.split("=") for word in values.split())}
    if name == "PUSHCAN.FocFeedback":
        known |= {"hardware_version": b"HW-V1.0", "software_version": b"SW-V2.2.3"}
    vectors = {v["name"]: v["fields"] for v in json.loads((VECTORS / "tm_golden.json").read_text())}
    assert encode.packet(name, count, unit, end, **known) == bytes(vectors[vector]["data"])


def test_candump_lines() -> None:
    frame = encode.Frame(0x1F040A05, b"\x41\x00", 1_700_000_000_123_456_789)
    status = encode.Frame(4, bytes(8), error=True)
    assert encode.log_line(frame) == "(1700000000.123456) can0 1F040A05#4100"
    assert encode.log_line(frame, 9) == "(1700000000.123456789) can0 1F040A05#4100"
    assert encode.log_line(encode.Frame(0x123, fd=True, extended=False, direction="T")).endswith(" can0 123##1 T")
    assert encode.log_line(encode.Frame(5, remote=True)).endswith(" can0 00000005#R")
    assert encode.log_line(encode.Frame(5, remote=True, dlc=8)).endswith(" can0 00000005#R8")
    assert encode.log_line(encode.Frame(5, bytes(8), dlc=14)).endswith(" can0 00000005#0000000000000000_E")
    assert encode.log_line(status).endswith(" can0 20000004#0000000000000000")
    assert encode.console_line(frame) == "  can0  1F040A05   [2]  41 00"
    assert encode.console_line(frame, "a") == " (1700000000.123456)  can0  1F040A05   [2]  41 00"
    assert encode.console_line(frame, "z", since=1_700_000_000 * 10**9) == " (000.123456)  can0  1F040A05   [2]  41 00"
    assert encode.console_line(frame, "A") == " (2023-11-14 22:13:20.123456)  can0  1F040A05   [2]  41 00"
    assert encode.console_line(frame, extra=True) == "  can0  RX - -  1F040A05   [2]  41 00"
    assert encode.console_line(frame, text=True) == f"  can0  1F040A05   [2]  41 00{' ' * 18}   'A.'"
    assert encode.console_line(status) == "  can0  20000004   [8]  00 00 00 00 00 00 00 00   ERRORFRAME"
    assert encode.console_line(encode.Frame(5, remote=True)) == "  can0  00000005   [0]  remote request"
    assert encode.console_line(encode.Frame(5, bytes(12), fd=True)).startswith("  can0  00000005  [12]  00 00")
    assert encode.drop_line("can0", 2, 7) == "DROPCOUNT: dropped 2 CAN frames on 'can0' socket (total drops 7)"


def test_the_bus_sends_the_lowest_id_first_and_keeps_the_order_of_one_id() -> None:
    low, high = encode.Frame(1, b"a"), encode.Frame(9, b"b")
    bus = encode.Bus()
    bus.send(0, [high, replace_data(high, b"c")])
    bus.send(1000, [low])
    assert [f.data for f, _ in bus.run()] == [b"b", b"a", b"c"]


def replace_data(frame: encode.Frame, data: bytes) -> encode.Frame:
    return encode.Frame(frame.id, data)
