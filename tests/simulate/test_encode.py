"""The simulator's encoder and framing against pydronecan and the golden vectors."""

from __future__ import annotations

import json
import math
import random
from typing import TYPE_CHECKING, Any

import pytest
from dronecan import transport
from hypothesis import given
from hypothesis import strategies as st
from kit import VECTORS
from kit.encode import DLC_LENGTHS
from kit.libraries import HALVES, fill, frames_of, new, plain, transfer

from analyzer.simulate import wire
from analyzer.simulate.encode import compiled, float_code
from dissectors.traffic import Sending

if TYPE_CHECKING:
    from dissectors.registry import Registry


def has_nan(value: Any) -> bool:
    if isinstance(value, dict):
        return any(map(has_nan, value.values()))
    if isinstance(value, list):
        return any(map(has_nan, value))
    return isinstance(value, float) and math.isnan(value)


def test_every_standard_type_as_pydronecan_packs_it(registry: Registry) -> None:
    """NaN is left out: a number cannot say which of its codes was meant."""
    numbers = random.Random(4)
    compared = 0
    for kind, known in HALVES:
        message = registry.message(("message", "", "request", "response").index(kind), known.default_dtid)
        assert message is not None
        payload = compiled(message.layout)
        for number in range(6):
            value = new(known, kind)
            fill(value, numbers, ("least", "most", "any")[min(number, 2)])
            values = plain(value)
            if has_nan(values):
                continue
            theirs = transfer(kind, value, number, fd=False)
            ours = Sending(
                11, message, values, None if kind == "message" else 22, number, number, message.signature,
                payload=payload(values),
            )  # fmt: skip
            assert ours.payload == bytes(theirs.payload), message.full_name
            sent = [(frame.id, frame.data) for frame in wire.frames(ours)]
            assert sent == [(frame.id, frame.data) for frame in frames_of(theirs)], message.full_name
            compared += 1
    assert compared > 600


def test_anonymous_frames_of_the_golden_vectors(registry: Registry) -> None:
    vectors = [v for v in json.loads((VECTORS / "neighbours.json").read_text()) if v["source"] == 0]
    assert vectors
    for vector in vectors:
        message = registry.resolve(vector["dsdl"])
        values = vector["fields"]
        sending = Sending(0, message, values, None, 0, vector["transfer_id"], message.signature, anonymous=True)
        sending.payload = compiled(message.layout)(values)
        (frame,) = wire.frames(sending)
        expected = vector["frames"][0]
        sending.priority = int(expected["id"], 16) >> 24
        (frame,) = wire.frames(sending)
        assert frame.data.hex().upper() == expected["data"]
        # The discriminator is the sender's choice: 14 bits of a CRC here. Everything else is given.
        assert frame.id & ~(0x3FFF << 10) == int(expected["id"], 16) & ~(0x3FFF << 10)


@given(st.binary(max_size=300), st.integers(0, 31))
def test_can_fd_frames_hold_their_body_and_zeros(body: bytes, transfer_id: int) -> None:
    parts = wire.cut(0x1234, body, transfer_id, fd=True)
    assert all(len(part.data) in DLC_LENGTHS and part.fd for part in parts)
    joined = b"".join(part.data[:-1] for part in parts)
    assert joined[: len(body)] == body
    assert joined[len(body) :].strip(b"\0") == b""
    tails = [part.data[-1] for part in parts]
    assert [tail & 31 for tail in tails] == [transfer_id] * len(parts)
    assert [tail >> 7 for tail in tails] == [1] + [0] * (len(parts) - 1)
    assert [tail >> 6 & 1 for tail in tails] == [0] * (len(parts) - 1) + [1]
    assert [tail >> 5 & 1 for tail in tails] == [at % 2 for at in range(len(parts))]


@pytest.mark.parametrize("value", [0.0, -0.0, 1.0, 50.2, -273.15, 65504.0, 6e-8])
def test_float16_as_pydronecan_rounds_it(value: float) -> None:
    assert float_code(value, 16) == transport.f16_from_f32(value)


@pytest.mark.parametrize(
    ("value", "code"),
    [(65520.0, 0x7BFF), (1e9, 0x7BFF), (-1e300, 0xFBFF), (math.inf, 0x7C00), (-math.inf, 0xFC00)],
)
def test_float16_saturates_and_keeps_infinity(value: float, code: int) -> None:
    """The standard's saturation holds for numbers; pydronecan clamps infinity, too."""
    assert float_code(value, 16) == code


def test_the_check_value_of_the_crc() -> None:
    assert wire.crc16(b"123456789") == 0x29B1
