"""MCAP files of every shape that the format allows, those of the public conformance suite among them, are valid."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import pytest
from kit.conformance import CHANNEL, INPUTS, Variant, message, number, variants
from kit.mcaps import cut, from_file, from_pieces
from mcap.opcode import Opcode

from analyzer.sources import Source
from analyzer.sources.mcap import summary

if TYPE_CHECKING:
    from pathlib import Path

# Of files of the suite, as its repository states them.
DIGESTS = {
    "NoData": "f720b819f6ca7330",
    "OneAttachment-ax-pad-st-sum": "37faf0439dcf55de",
    "OneMetadata-mdx-pad-sum": "443c8f2490bd07cc",
    "TenMessages-ch-chx-mx-pad-rch-rsh-st-sum": "358413d53e6fb275",
}
# Behind the fields of a footer, and of whatever else may have more.
FOOTERS, PADDINGS = (b"", b"\1\xff\xff", b"y" * 300), (b"\1\xff\xff", b"\0" * 200, bytes(range(1, 16)) * 300)


def test_they_are_those_of_the_suite() -> None:
    made = {one.name: one for one in variants()}
    assert len(made) == 416
    for name, digest in DIGESTS.items():
        assert hashlib.sha256(made[name].data()).hexdigest().startswith(digest), name


def test_all_of_them_are_valid() -> None:
    for one in variants():
        got = from_pieces([one.data()])
        assert (got.told, got.lines["other"]) == (False, one.messages), one.name


@pytest.mark.slow
@pytest.mark.parametrize("footer", FOOTERS, ids=len)
def test_all_of_them_are_valid_however_they_come(footer: bytes) -> None:
    for one in variants():
        data = one.data(footer=footer)
        got = from_pieces([data])
        assert (got.told, got.lines["other"]) == (False, one.messages), one.name
        if "pad" in one.parts:
            assert from_pieces(cut(data, 1)) == got, one.name


@pytest.mark.slow
@pytest.mark.parametrize("padding", PADDINGS, ids=len)
def test_however_much_stands_behind_the_fields(padding: bytes) -> None:
    for one in variants():
        if "pad" in one.parts and "st" in one.parts:
            got = from_pieces(cut(one.data(padding, padding), 999))
            assert (got.told, got.lines["other"]) == (False, one.messages), one.name


@pytest.mark.slow
def test_padded_definitions_in_a_row_and_large_ones() -> None:
    channels = [(Opcode.CHANNEL, number(2, k) + CHANNEL[1][2:]) for k in range(2, 30)]
    attached = b"x" * 20_000_000
    body = number(8, 0, 0) + number(4, 0, 0) + number(8, len(attached)) + attached + number(4, 0)
    records = (*INPUTS["OneMessage"], *channels, (Opcode.ATTACHMENT, body), message(11, 3, 3))
    for parts in ({"pad", "rch", "sum"}, {"pad", "ch", "st"}):
        one = Variant("many", records, frozenset(parts))
        got = from_pieces(cut(one.data(), 1 << 20))
        assert (got.told, got.lines["other"]) == (False, 2)


def test_a_longer_footer_leads_to_the_definitions(tmp_path: Path) -> None:
    (one,) = (one for one in variants() if one.name == "OneMessage-pad-rch-rsh")
    for footer in FOOTERS:
        got = from_file(tmp_path / "x.mcap", one.data(footer=footer))
        assert not got.told
        assert len(summary.read(Source(str(tmp_path / "x.mcap")), lambda: True)) == 2


def test_a_wrong_length_is_no_padding() -> None:
    """One changed byte in the length of a channel: it ends where a later message begins, and swallows none."""
    (one,) = (one for one in variants() if one.name == "TenMessages-st")
    data = bytearray(one.data())
    at = data.index(bytes([Opcode.CHANNEL]) + number(8, len(CHANNEL[1]))) + 1
    step = len(message(0, 0, 0)[1]) + 9
    data[at : at + 8] = number(8, len(CHANNEL[1]) + 3 * step)
    assert from_pieces([bytes(data)]).told


def test_a_padded_file_that_is_cut_says_so() -> None:
    (one,) = (one for one in variants() if one.name == "TenMessages-pad-rch-rsh-st-sum")
    data = one.data()
    for size in range(8, len(data)):
        got = from_pieces([data[:size]])
        assert got.damage.startswith(f"byte {size}: MCAP data ends early"), size
        assert not got.texts, size
