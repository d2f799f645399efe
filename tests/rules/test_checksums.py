"""Wrong CRCs, many at once: which ones a mistake may give, and which ones one turned bit explains."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from kit import encode
from kit.judged import registry

from analyzer.rules.diagnosis import checksums
from analyzer.rules.diagnosis.checksums import one_bit, one_bit_of_each
from dissectors.kit import Types
from dissectors.kit.definitions import crc_start

if TYPE_CHECKING:
    import pytest

SIGNATURE = 0xA9AF28AEA2FBB254
OTHER = 0xC67490B59FD75681
START = crc_start(SIGNATURE)


@st.composite
def wrong_crcs(draw: st.DrawFn) -> tuple[int, bytes]:
    """A CRC that does not fit and its payload: damage, or anything that a sender may have done."""
    payload = draw(st.binary(max_size=30)) + bytes(draw(st.integers(0, 70)))
    right = encode.crc16(payload, START)
    start = draw(st.sampled_from([0, 0xFFFF, crc_start(OTHER), draw(st.integers(0, 0xFFFF))]))
    ways = [
        right ^ 0xFFFF,
        right >> 8 | (right & 0xFF) << 8,
        encode.crc16(payload, start),
        draw(st.integers(0, 0xFFFF)),
    ]
    for signature in (SIGNATURE.to_bytes(8, "big"), SIGNATURE.to_bytes(8, "little")):
        ways += [encode.crc16(signature + payload, first) for first in (0, 0xFFFF)]
    ways.append(encode.crc16(payload.rstrip(b"\0"), START))
    if draw(st.booleans()):
        return int.from_bytes(payload[:2], "little"), payload[2:] + right.to_bytes(2, "little")
    return draw(st.sampled_from(ways)), payload


@given(st.lists(wrong_crcs(), max_size=12))
def test_crcs_that_no_mistake_gives_are_left_out(rows: list[tuple[int, bytes]]) -> None:
    """Of those that a closer look finds none is left out."""
    types = Types(registry())
    wire = np.array([crc for crc, _ in rows], np.int64)
    begins = np.cumsum([0, *(len(payload) for _, payload in rows)])
    data = np.frombuffer(b"".join(payload for _, payload in rows), np.uint8)
    may = checksums.may_be_mistaken(types, np.full(len(rows), 1034), wire, begins, data)
    for one, (crc, payload) in zip(may.tolist(), rows, strict=True):
        given = crc, payload, types.signatures(1034)
        close = checksums.wrong_crc(*given, types.mistaken(1034)) is not None or bool(checksums.formulas(*given))
        assert one or not close
        assert close or not one, "none is looked at in vain"


@given(st.lists(st.tuples(st.integers(0, 0xFFFF) | st.sampled_from([1 << k for k in range(16)]), st.integers(0, 100))))
def test_one_turned_bit_of_many(rows: list[tuple[int, int]]) -> None:
    difference, length = np.array(rows, np.int64).reshape(-1, 2).T
    each = [one_bit(*row) for row in rows]
    assert one_bit_of_each(difference, length).tolist() == [-1 if one is None else one for one in each]


def test_start_values_are_those_of_the_signatures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dissectors.kit.definitions._MOST_CODES", 1)
    types = Types(registry())
    for code in (1034, 341, 20999, 1034):
        assert types.starts(code) == [crc_start(one) for one in types.signatures(code)]
