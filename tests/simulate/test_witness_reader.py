"""The witness must read right before it may testify: golden vectors, and captures of the independent sender."""

from __future__ import annotations

import json
from typing import Any

import pytest
from kit import CAPTURES, VECTORS, encode
from witness import can, push_form, reader, views

CLEAN = ("hover", "services", "fd")


def golden() -> list[object]:
    return [
        pytest.param(name, vector, id=f"{name}-{vector['name']}")
        for name in ("tm_golden", "tm_golden_fd", "neighbours")
        for vector in json.loads((VECTORS / f"{name}.json").read_text())
    ]


@pytest.fixture(scope="module")
def logs() -> dict[str, reader.Log]:
    paths = [*VECTORS.glob("*.log"), *(CAPTURES / f"{name}.log" for name in CLEAN)]
    return {path.stem: reader.Log(path.read_text()) for path in paths}


def comparable(value: Any) -> Any:
    """Floats as raw codes."""
    if isinstance(value, dict):
        return {name: comparable(item) for name, item in value.items()}
    if isinstance(value, list):
        return [comparable(item) for item in value]
    return f"{value.width}:{value.code:X}" if isinstance(value, views.Float) else value


def expected(layout: str, values: dict[str, Any]) -> dict[str, Any]:
    """The values of a vector in the same form."""
    found = {}
    for name, base, _, how in encode.parse(layout)[1]:
        if f"{name}__raw16" in values:
            found[name] = f"16:{int(values[f'{name}__raw16'], 16):X}"
        elif name in values:
            items = [coded(base, item) for item in (values[name] if how else [values[name]])]
            found[name] = items if how else items[0]
    return found


def coded(base: str, value: Any) -> Any:
    if base in encode.RECORDS:
        return expected(encode.RECORDS[base], value)
    if base[0] != "f":
        return value
    bits = encode.scalar(base, value)
    return f"{base[1:]}:{int.from_bytes(encode.to_bytes(bits), 'little'):X}"


@pytest.mark.parametrize(("name", "vector"), golden())
def test_golden_transfers(name: str, vector: dict[str, Any], logs: dict[str, reader.Log]) -> None:
    rows = {frame["line"] for frame in vector["frames"]}
    (transfer,) = [t for t in logs[name].transfers if t.numbers & rows]
    assert (transfer.numbers, transfer.status) == (rows, "ok")
    first = transfer.first
    assert (first.src, first.tid, first.dst) == (vector["source"], vector["transfer_id"], vector.get("dest"))
    assert (first.type_id, first.service) == (vector["dtid"], vector.get("service", False))
    payload = bytes.fromhex(vector["payload"])
    assert transfer.payload[: len(payload)] == payload
    assert not any(transfer.payload[len(payload) :])
    if vector.get("transfer_crc"):
        assert transfer.crc == int(vector["transfer_crc"], 16)
    got = views.unpack(transfer.name, payload, fd=first.fd)
    assert comparable(got.values) == expected(encode.TYPES[transfer.name].layout, vector["fields"])
    assert (got.missing, "1" in got.rest, any(got.voids)) == (False, False, False)
    assert len(got.rest) < 8


@pytest.mark.parametrize("name", CLEAN)
def test_every_frame_of_a_clean_capture_is_understood(name: str, logs: dict[str, reader.Log]) -> None:
    log = logs[name]
    assert {transfer.status for transfer in log.transfers} == {"ok"}
    assert sorted(n for t in log.transfers for n in t.numbers) == [frame.number for frame in log.frames]
    assert (log.orphans, log.errors) == ([], [])
    for transfer in log.transfers:
        got = views.unpack(transfer.name, transfer.payload, fd=transfer.first.fd)
        assert (got.missing, "1" in got.rest) == (False, False)
        again = encode.to_bytes(encode.encode(encode.TYPES[transfer.name].layout, got.values, not transfer.first.fd))
        assert transfer.payload[: len(again)] == again


def block(logs: dict[str, reader.Log], name: str) -> tuple[list[reader.Transfer], list[reader.Frame]]:
    """The transfers and the orphans of one block of the violations."""
    (found,) = [v for v in json.loads((VECTORS / "violations.json").read_text()) if v["name"] == name]
    rows = range(found["first_line"], found["last_line"] + 1)
    log = logs["violations"]
    return [t for t in log.transfers if t.first.line in rows], [f for f in log.orphans if f.line in rows]


@pytest.mark.parametrize(
    ("name", "statuses", "orphans"),
    [
        ("clean_reference", ["ok"] * 3, 0),
        ("missing_middle", ["interrupted", "ok"], 0),
        ("swapped_2_3", ["interrupted", "ok"], 1),
        ("stalled_2_5s", ["timed out"], 2),
        ("crc_bit_error", ["bad crc", "ok"], 0),
    ],
)
def test_damage(name: str, statuses: list[str], orphans: int, logs: dict[str, reader.Log]) -> None:
    transfers, strays = block(logs, name)
    assert ([transfer.status for transfer in transfers], len(strays)) == (statuses, orphans)


def test_a_line_that_no_recorder_writes_is_refused() -> None:
    with pytest.raises(ValueError, match="line 2"):
        reader.Log("(1700000000.000000) can0 1F040601#C0\n(1700000000.000001) can0 1F04061#C0\n")


def test_numbers_leave_error_frames_out_and_lines_do_not() -> None:
    text = "(1700000000.000000) can0 {}\n"
    log = reader.Log("".join(text.format(line) for line in ("1F040601#C0", "20000004#0004000000000000", "123#R4")))
    assert [(f.number, f.line, f.error, f.extended) for f in log.lines] == [
        (1, 1, False, True),
        (0, 2, True, False),
        (2, 3, False, False),
    ]
    assert (log[2].remote, log[2].dlc, log[2].id) == (True, 4, 0x123)


def test_crc_backwards() -> None:
    payload = bytes(range(40))
    for signature in (None, 0x217F5C87D7EC951D):
        start = reader.crc(b"", signature)
        assert can.crc_start(payload, reader.crc(payload, signature)) == start
    assert reader.crc(b"123456789", None) == 0x29B1  # 5.1


def test_packets_are_split_one_behind_the_other() -> None:
    one = encode.packet("PUSHCAN.MotorStatus", 7, 0xA2, speed=-300, voltage=4810)
    two = encode.packet("PUSHCAN.FocFeedback", 8, 0xA2, hardware_version=b"HW1", save_option=1)
    carried = {"data_sequence": 0, "data": list(one + two + b"\x7b\x8c\x99")}
    frames = encode.transfer("PUSHCAN", carried, 11, 0).frames()
    found = push_form.pieces(reader.Log("".join(encode.log_line(frame) + "\n" for frame in frames)))
    assert [(p.name, len(p.data)) for p in found] == [("PUSHCAN.MotorStatus", 28), ("PUSHCAN.FocFeedback", 55), ("", 3)]
    first, values = found[0], found[0].read()
    assert (values["speed"], values["voltage"], values["fault"]) == (-300, 4810, 0)
    assert (first.direction, first.frame_id, first.count, first.unit, first.length) == ("PUSHCAN", 0x15, 7, 0xA2, 28)
    assert (first.summed(), found[1].summed(28), found[2].sound) == (True, False, False)


def test_what_is_missing_or_left_over_is_told() -> None:
    short = views.unpack("ESCStatus", bytes(6))
    assert (short.missing, list(short.values)) == (True, ["error_count", "voltage"])
    long = views.unpack("uavcan.equipment.safety.ArmingStatus", b"\xff\x01")
    assert (long.values, long.rest) == ({"status": 255}, "00000001")
    union = views.unpack("uavcan.protocol.param.GetSet.Request", bytes([0, 7]))
    assert union.tag == 7
    spare = views.unpack("RawCommand", b"\xff\x7f")
    assert (spare.values, spare.rest) == ({"cmd": [8191]}, "11")
