"""The golden vectors, of encoders that nobody here wrote, come out field by field; the violations must show."""

from __future__ import annotations

import json
import math
import struct
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from kit import VECTORS, encode
from kit.traffic import differing

if TYPE_CHECKING:
    from collections.abc import Callable

GOLDEN = ("tm_golden", "tm_golden_fd", "neighbours")


def load(name: str) -> list[dict[str, Any]]:
    return json.loads((VECTORS / f"{name}.json").read_text())


def text(name: str) -> bytes:
    return (VECTORS / f"{name}.log").read_bytes()


@pytest.fixture(scope="module")
def files(decode: Callable[..., Any]) -> dict[str, Any]:
    return {name: decode(text(name)) for name in (*GOLDEN, "violations")}


def table_of(vector: dict[str, Any]) -> str:
    if "type" in vector:
        return vector["type"]
    return vector["dsdl"] + (("", ".Request" if vector["request"] else ".Response")[vector["service"]])


@pytest.mark.parametrize(("file", "at"), [(name, k) for name in GOLDEN for k in range(len(load(name)))])
def test_golden(files: dict[str, Any], file: str, at: int) -> None:
    vector, got = load(file)[at], files[file]
    lines = [frame["line"] for frame in vector["frames"]]
    number, row = next(
        (k, row) for k, row in enumerate(got.transfers) if got.frames[row["frame"][0]]["line"] == lines[0]
    )
    frames = [got.frames[k] for k in row["frame"]]
    assert [(f["line"], f"{f['id']:08X}", f["data"].hex().upper()) for f in frames] == [
        (f["line"], f["id"], f["data"]) for f in vector["frames"]
    ]
    assert (row["status"], row["type_id"], row["transfer_id"]) == ("ok", vector["dtid"], vector["transfer_id"])
    assert (row["src"], row["dst"]) == (vector["source"], vector.get("dest"))
    assert row["priority"] == int(vector["frames"][0]["id"], 16) >> 24
    assert row["fd"] == vector.get("canfd", False)
    many = len(frames) > 1
    assert row["crc_wire"] == row["crc_here"]
    assert (row["crc_wire"] is not None) == many
    if vector.get("transfer_crc"):
        assert row["crc_wire"] == int(vector["transfer_crc"], 16)
    assert row["anomaly"] == ({"can fd"} if row["fd"] else set())

    table, message = got.message_of(number)
    assert table == table_of(vector)
    assert (message["trusted"], message["bad_tag"], message["pad_nonzero"]) == (True, False, False)
    kept = len(row["payload"]) - message["bits_left"] // 8
    assert row["payload"][:kept].hex().upper() == vector["payload"]
    assert not any(row["payload"][kept:])
    fields = {name: value for name, value in vector["fields"].items() if not name.endswith("__raw16")}
    raw = {name.removesuffix("__raw16"): int(v, 16) for name, v in vector["fields"].items() if name.endswith("__raw16")}
    assert differing({name: value for name, value in fields.items() if name not in raw}, message) == {}
    for name, code in raw.items():
        value = message[name]
        if math.isnan(value):
            assert code & 0x7C00 == 0x7C00, name
            assert code & 0x3FF, name
        else:
            assert struct.unpack("<H", struct.pack("<e", value))[0] == code, name


@pytest.mark.parametrize("file", GOLDEN)
def test_nothing_else_comes_out(files: dict[str, Any], file: str) -> None:
    got = files[file]
    assert len(got.transfers) == len(load(file))
    assert set(got.verdicts) == {"used"}
    assert got.events == []


def test_a_nan_keeps_its_payload(files: dict[str, Any]) -> None:
    """float16 widens to float32 with sign and fraction, so that the raw code can be told from the column."""
    for file in ("tm_golden", "tm_golden_fd"):
        seen = 0
        for vector, row in zip(load(file), files[file].transfers, strict=True):
            assert row["transfer_id"] == vector["transfer_id"]
            seen += any(code.endswith("__raw16") for code in vector["fields"])
        codes = [
            v["fields"][f"{n}__raw16"]
            for v in load(file)
            for n in ("voltage", "current", "temperature")
            if f"{n}__raw16" in v["fields"]
        ]
        columns = [[], [], []]
        for batch in files[file].batches:
            for k, name in enumerate(("voltage", "current", "temperature")):
                columns[k].append(batch.messages["ESCStatus"].column(name).to_numpy())
        bits = np.stack([np.concatenate(column) for column in columns], 1).reshape(-1).view(np.uint32)
        expected = np.array([int(code, 16) for code in codes], np.uint32)
        special = expected & 0x7C00 == 0x7C00
        wanted = (expected & 0x8000) << 16 | 0x7F800000 | (expected & 0x3FF) << 13
        assert seen == len(bits) // 3
        assert special.sum() > 2
        assert bits[special].tolist() == wanted[special].tolist()


# What a rule of the layers CAN and TRF finds in the tables: (where, anomaly, status of the transfer).
VISIBLE = {
    "CAN-005": ("frame", "no tail", None),
    "CAN-006": ("transfer", "destination zero", "ok"),
    "TRF-001": ("transfer", "single toggle", "ok"),
    "TRF-003": ("transfer", "toggle", "interrupted"),
    "TRF-006": ("transfer", "abandoned", "interrupted"),
    "TRF-007": ("transfer", "timeout", "timed out"),
    "TRF-010": ("transfer", "crc", "bad crc"),
    "TRF-012": ("transfer", "frame not full", "ok"),
    "TRF-013": ("transfer", "last frame empty", "ok"),
    "TRF-015": ("transfer", "needless multi", "ok"),
    "TRF-017": ("transfer", "duplicate", "ok"),
    "TRF-026": ("transfer", "interleaved", "ok"),
}
BY_VALUE = {"TRF-011", "TRF-021"}  # no bit: both CRCs, and the kinds of the transfers, say it
# How many transfers of a block are broken, and which of its frames are in none.
BROKEN = {"missing_middle": 1, "swapped_2_3": 1, "missing_last": 1, "stalled_2_5s": 1, "crc_bit_error": 1,
          "crc_without_signature": 1, "last_frame_zero_padded": 1}  # fmt: skip
STRAY = {"stalled_2_5s": ["orphan", "orphan"], "swapped_2_3": ["orphan"], "dlc_0": ["no tail"]}
BLOCKS = load("violations")
LAYERS = [
    block for block in BLOCKS if not block["expect"] or any(rule[:3] in ("TRF", "CAN") for rule in block["expect"])
]


def block_of(got: Any, first: int, last: int) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The transfers and frames of some lines."""
    frames = {k: row for k, row in enumerate(got.frames) if first <= row["line"] <= last}
    rows = [row for row in got.transfers if row["frame"][0] in frames]
    assert all(set(row["frame"]) <= frames.keys() for row in rows)
    return rows, list(frames.values())


def check_block(block: dict[str, Any], rows: list[dict[str, Any]], frames: list[dict[str, Any]]) -> None:
    rules = [rule for rule in block["expect"] if rule[:3] in ("TRF", "CAN") and rule not in BY_VALUE]
    for rule in rules:
        where, anomaly, status = VISIBLE[rule]
        marked = [row for row in (frames if where == "frame" else rows) if anomaly in row["anomaly"]]
        assert marked, rule
        assert status is None or {row["status"] for row in marked} == {status}, rule
    allowed = {VISIBLE[rule][1] for rule in rules}
    assert {name for row in rows for name in row["anomaly"]} <= allowed | ({"frame not full"} & allowed)
    assert sum(row["status"] != "ok" for row in rows) == BROKEN.get(block["name"], 0)
    assert sorted(f["verdict"] for f in frames if f["verdict"] != "used") == STRAY.get(block["name"], [])
    if "TRF-003" in rules:
        assert sum("toggle" in frame["anomaly"] for frame in frames) == 1


def test_every_rule_of_the_two_layers_is_mapped() -> None:
    rules = {rule for block in BLOCKS for rule in block["expect"] if rule[:3] in ("TRF", "CAN")}
    assert rules == VISIBLE.keys() | BY_VALUE
    assert len(LAYERS) == 16


@pytest.mark.parametrize("block", LAYERS, ids=lambda block: block["name"])
def test_violation(files: dict[str, Any], block: dict[str, Any]) -> None:
    check_block(block, *block_of(files["violations"], block["first_line"], block["last_line"]))


ALONE = [block for block in LAYERS if block["name"] != "single_toggle_1"]


@pytest.mark.parametrize("block", ALONE, ids=lambda block: block["name"])
def test_violation_alone(decode: Callable[..., Any], block: dict[str, Any]) -> None:
    lines = text("violations").splitlines(keepends=True)[block["first_line"] - 1 : block["last_line"]]
    got = decode(b"".join(lines))
    check_block(block, *block_of(got, 1, len(lines)))


def test_alone_a_single_frame_with_toggle_1_could_be_cyphal(decode: Callable[..., Any]) -> None:
    block = next(block for block in LAYERS if block["name"] == "single_toggle_1")
    got = decode(text("violations").splitlines(keepends=True)[block["first_line"] - 1])
    assert got.verdicts == ["foreign"]


def only(files: dict[str, Any], name: str) -> list[dict[str, Any]]:
    block = next(block for block in BLOCKS if block["name"] == name)
    return block_of(files["violations"], block["first_line"], block["last_line"])[0]


def test_the_cause_of_a_wrong_crc_can_be_found(files: dict[str, Any]) -> None:
    """TRF-011 needs the payload and both values."""
    (row,) = only(files, "crc_without_signature")
    start = encode.signature_crc(encode.TYPES["ESCStatus"].signature)
    assert row["crc_here"] == encode.crc16(row["payload"], start) != row["crc_wire"] == encode.crc16(row["payload"])
    (row,) = only(files, "last_frame_zero_padded")
    start = encode.signature_crc(encode.TYPES["ParamCfg"].signature)
    assert row["crc_here"] == encode.crc16(row["payload"], start)
    assert row["crc_wire"] == encode.crc16(row["payload"][:27], start)
    assert row["payload"][27:] == bytes(len(row["payload"]) - 27) != b""


def test_a_response_without_a_request_shows_as_one(files: dict[str, Any]) -> None:
    rows = only(files, "response_without_request")  # TRF-021
    answers = [row for row in rows if row["kind"] == "response"]
    assert [(row["type_id"], row["src"], row["dst"], row["transfer_id"]) for row in answers] == [(1, 10, 1, 3)]
    earlier = [row for row in files["violations"].transfers if row["kind"] == "request"]
    assert [(row["src"], row["dst"]) for row in earlier] == [(1, 0)]


@pytest.mark.parametrize(
    ("block", "table", "shown"),
    [
        ("rawcommand_negative", "RawCommand", {"bits_left": 0}),
        ("rawcommand_bad_length_5", "RawCommand", {"bits_left": 12}),
        ("rawcommand_pad_bits", "RawCommand", {"pad_nonzero": True}),
        ("escstatus_13_bytes", "ESCStatus", {"bits_left": -6}),
        ("escstatus_pad_bits", "ESCStatus", {"pad_nonzero": True}),
        ("escstatus_inf", "ESCStatus", {"voltage": math.inf}),
        ("pushcan_with_length_prefix", "PUSHCAN", {"layout": 1}),
        ("push_other_direction", "PUSHSCI.MotorStatus", {"header_ok": False}),
        ("push_checksum", "PUSHCAN.MotorStatus", {"packet_ok": False, "checksum_ok": False, "length_ok": True}),
        ("push_unknown_frame_id", "PUSHCAN.unrecognized", {"reason": "unknown frame id"}),
        ("push_frame_count_gap", "PUSHCAN.MotorStatus", {"packet_ok": True, "count_step": 4}),
        ("push_0x06_mode_range_reserved", "PUSHSCI.OutputControl", {"packet_ok": True, "reserved": 1}),
        ("push_0x15_values", "PUSHCAN.MotorStatus", {"packet_ok": True}),
    ],
)
def test_violations_of_other_layers_are_in_their_columns(
    files: dict[str, Any], block: str, table: str, shown: dict[str, Any]
) -> None:
    found = next(one for one in BLOCKS if one["name"] == block)
    got = files["violations"]
    last = next(k for k, row in enumerate(got.transfers) if got.frames[row["frame"][-1]]["line"] == found["last_line"])
    assert got.transfers[last]["status"] == "ok"
    rows = [row for name, rows in got.messages.items() for row in rows if name == table and row["transfer"] == last]
    assert [{name: row[name] for name in shown} for row in rows] == [shown]
