"""pydronecan, which nobody here wrote, encodes random values of every standard type; the engine must show the same.

Values are made and packed with pydronecan's own objects. Floats are random bit patterns, so infinities, NaN and
subnormal numbers occur. `DIFFERENCES` lists where the two are not meant to agree.
"""

from __future__ import annotations

import random
from pathlib import Path
from typing import TYPE_CHECKING, Any

import dronecan
import pytest
from dronecan import dsdl, transport
from kit.encode import DLC_LENGTHS
from kit.libraries import HALVES, fill, frames_of, names_on_disk, new, plain, transfer
from kit.traffic import differing, lines
from kit.vendors import physical

if TYPE_CHECKING:
    from collections.abc import Callable

EXAMPLES = 7  # of each type on each kind of bus
DIFFERENCES = {
    "infinite float16": "pydronecan clamps to 65504 what is set; here raw codes are set, which both sides keep",
    "63-byte frames": "pydronecan pads CAN FD payloads of 62, 123, 186 and 249 bytes to a length that does not exist; "
    "the engine marks the frame and still decodes it",
    "mppt": "pydronecan bundles these two types without loading them; the engine knows all that is bundled",
    "over-long arrays": "pydronecan reads a tail array beyond its maximum; the engine stops there and counts bits_left",
    "short payloads": "pydronecan raises; the engine shows what there is and counts the missing bits as negative",
}
FD_BUG = (62, 123, 186, 249)


def test_every_type_with_an_id_takes_part() -> None:
    part = {name for name in names_on_disk() if not name.startswith("mppt/")}
    assert len(dronecan.DATATYPES) == len(part) == 124
    assert len(HALVES) == 124 + sum(
        known.kind == dsdl.CompoundType.KIND_SERVICE for known in dronecan.DATATYPES.values()
    )


@pytest.mark.sampled(2)
@pytest.mark.parametrize("fd", [False, True], ids=["classic", "fd"])
def test_values_of_every_type(decode: Callable[..., Any], fd: bool) -> None:
    numbers = random.Random(20260314)
    sent, text = [], []
    for kind, known in HALVES:
        for number in range(EXAMPLES):
            value = new(known, kind)
            fill(value, numbers, ("least", "most", "any")[min(number, 2)])
            theirs = transfer(kind, value, number, fd)
            sent.append((kind, known, value, bytes(theirs.payload)))  # before to_frames adds padding to it
            text += frames_of(theirs)
    got = decode(lines(text))
    assert {row["status"] for row in got.transfers} == {"ok"}
    assert set(got.verdicts) == {"used"}
    rows = sorted(range(len(got.transfers)), key=lambda k: got.transfers[k]["frame"])
    wrong = {}
    for at, ((kind, known, value, payload), number) in enumerate(zip(sent, rows, strict=True)):
        row = got.transfers[number]
        assert (row["kind"], row["type_id"], row["transfer_id"]) == (kind, known.default_dtid, at % EXAMPLES)
        assert row["payload"][: len(payload)] == payload
        table, message = got.message_of(number)
        odd = differing(physical(known.full_name, plain(value)), message)
        spare = 8 * (len(row["payload"]) - len(payload))
        if odd or not spare <= message["bits_left"] < spare + 8 or message["bad_tag"] or message["pad_nonzero"]:
            wrong.setdefault(table, (odd, message["bits_left"], spare))
    assert wrong == {}


@pytest.mark.parametrize("size", [*range(58, 66), 122, 123, 124, 186, 249])
def test_the_padding_of_can_fd(decode: Callable[..., Any], size: int) -> None:
    """DIFFERENCES: 63-byte frames."""
    known = dronecan.TYPENAMES["com.tmotor.esc.PUSHCAN"]
    text, values = [], []
    for number in range(2):
        value = known(data_sequence=number, data=bytes(k % 251 for k in range(size - 5)))
        theirs = transfer("message", value, number, fd=True)
        assert len(theirs.payload) == size
        values.append(plain(value))
        text += frames_of(theirs)
    got = decode(lines(text))
    impossible = ["impossible length" in row["anomaly"] for row in got.frames]
    assert impossible == [len(frame.data) not in DLC_LENGTHS for frame in text]
    assert any(impossible) == (size in FD_BUG)
    assert [row["status"] for row in got.transfers] == ["ok", "ok"]
    assert [differing(value, row) for value, row in zip(values, got.messages["PUSHCAN"], strict=True)] == [{}, {}]


def test_an_infinity_is_kept(decode: Callable[..., Any]) -> None:
    """DIFFERENCES: infinite float16."""
    known = dronecan.TYPENAMES["uavcan.equipment.esc.Status"]
    value = known(voltage=float("inf"))
    assert value.voltage == 65504
    transport.get_fields(value)["voltage"]._bits = format(0xFC00, "016b")
    got = decode(lines(frames_of(transfer("message", value, 1, fd=False))))
    assert got.messages["ESCStatus"][0]["voltage"] == float("-inf")


def test_an_over_long_array_and_a_short_payload(decode: Callable[..., Any]) -> None:
    """DIFFERENCES: over-long arrays, short payloads."""
    known = dronecan.TYPENAMES["com.tmotor.esc.PUSHCAN"]
    theirs = transfer("message", known(data_sequence=7, data=bytes(255)), 1, fd=False)
    theirs.payload += bytes([1, 2])
    again = transport.Transfer()
    again.from_frames(theirs.to_frames())
    assert len(again.payload.data) == 257
    row = decode(lines(frames_of(theirs))).messages["PUSHCAN"][0]
    assert (len(row["data"]), row["bits_left"], row["layout"]) == (255, 16, 0)

    theirs.payload = theirs.payload[:3]
    with pytest.raises(ValueError, match="Not enough bits"):
        again.from_frames(theirs.to_frames())
    row = decode(lines(frames_of(theirs))).messages["PUSHCAN"][0]
    assert (row["bits_left"], row["data"]) == (-8, None)


def test_the_types_that_are_bundled_but_not_loaded(registry: Any) -> None:
    """DIFFERENCES: mppt."""
    bundled = sorted(name for name in names_on_disk() if name.startswith("mppt/"))
    assert len(bundled) == 2
    for name in bundled:
        type_id = int(Path(name).name.split(".")[0])
        assert (type_id, dsdl.CompoundType.KIND_MESSAGE) not in dronecan.DATATYPES
        assert any(registry.message(kind, type_id) is not None for kind in (0, 2))
    assert set(DIFFERENCES) >= {"mppt", "63-byte frames", "infinite float16", "short payloads", "over-long arrays"}
