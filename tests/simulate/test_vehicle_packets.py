"""Packets of PUSHSCI and PUSHCAN as raw values: built, read and changed (4.4.4, 4.4.5)."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import encode

from dissectors.tmotor.traffic.float16 import printed
from dissectors.tmotor.traffic.packets import change, packet, sound, split

NAMES = [name.partition(".") for name in encode.PACKETS]
RANGES = {"B": (0, 0xFF), "H": (0, 0xFFFF), "h": (-0x8000, 0x7FFF)}


@st.composite
def filled(draw: st.DrawFn) -> tuple[str, str, dict[str, Any]]:
    """A carrier, a packet of it, and any values."""
    carrier, _, name = draw(st.sampled_from(NAMES))
    values: dict[str, Any] = {}
    for field in encode.PACKETS[f"{carrier}.{name}"][1].split():
        key, code = field.split(":")
        values[key] = draw(st.integers(*RANGES[code]) if code in RANGES else st.binary(min_size=16, max_size=16))
    return carrier, name, values


@given(filled(), st.integers(0, 255), st.integers(0, 255))
def test_a_packet_is_that_of_a_foreign_builder(what: tuple[str, str, dict[str, Any]], count: int, unit: int) -> None:
    carrier, name, values = what
    data = packet(name, count, unit, values)
    assert data == encode.packet(f"{carrier}.{name}", count, unit, **values)
    found, read = split(data)
    assert (found, read["frame_count"], read["unit_id"], read["length"]) == (name, count, unit, len(data))
    assert values.items() <= read.items()
    assert sound(data)


@given(filled())
def test_the_other_byte_order_turns_numbers_round_and_nothing_else(what: tuple[str, str, dict[str, Any]]) -> None:
    _, name, values = what
    data = packet(name, 1, 0xA1, values, big_endian=True)
    assert values.items() <= split(data, big_endian=True)[1].items()
    assert sorted(data[:-1]) == sorted(packet(name, 1, 0xA1, values)[:-1])
    assert sound(data)


@given(filled(), st.integers(0, 255))
def test_a_change_changes_one_field_and_the_checksum(what: tuple[str, str, dict[str, Any]], count: int) -> None:
    _, name, values = what
    data = packet(name, 1, 0xA1, values)
    changed = change(data, frame_count=count)
    assert [at for at in range(len(data) - 1) if data[at] != changed[at]] == ([3] if count != 1 else [])
    assert sound(changed)
    stale = change(data, resum=False, frame_count=count)
    printed = name == "FocParameters" and stale[-1] == sum(stale[:28]) & 0xFF  # another range that is sound, too
    assert sound(stale) == (count == 1 or printed)
    assert split(change(data, checksum=7))[1]["checksum"] == 7


def test_both_checksum_ranges_of_a_setting_are_sound() -> None:
    """4.4.4 table 2 no 31."""
    values = {"report_rate": 0x0101, "save_option": 1}
    whole, part = packet("FocParameters", 0, 0xA1, values), packet("FocParameters", 0, 0xA1, values, sum_end=28)
    assert whole[:-1] == part[:-1]
    assert whole[-1] == part[-1] + 2
    assert sound(whole)
    assert sound(part)
    assert not sound(packet("FocParameters", 0, 0xA1, values, sum_end=29))
    assert change(whole, sum_end=28) == part


@pytest.mark.parametrize("data", [b"", b"\xec\x96", b"\xec\x96\x44" + bytes(9), b"\x7b\x8c\x1a" + bytes(4), bytes(12)])
def test_what_is_no_packet_is_an_error(data: bytes) -> None:
    for read in (split, change, sound):
        with pytest.raises(ValueError, match="no packet of the document"):
            read(data)


def test_a_misspelt_field_is_an_error() -> None:
    with pytest.raises(KeyError):
        change(packet("FocQuery", 0, 0xA1), frame_cnt=1)
    with pytest.raises(KeyError):
        packet("FocQuery", 0, 0xA1, {"unit": 1})


@pytest.mark.parametrize(("value", "wanted"), [(25.0, 25.125), (298.15, 300.0), (0.0, 4.76837158203125e-07)])
def test_the_printed_encoder_of_float16(value: float, wanted: float) -> None:
    """5.2, as it was measured in C."""
    assert printed(value) == wanted
    assert printed(-value) == -wanted


@given(st.floats(1e-3, 60_000))
def test_the_printed_encoder_is_up_to_0_8_percent_high(value: float) -> None:
    assert 0 <= printed(value) / value - 1 + 2**-11 < 0.0085
