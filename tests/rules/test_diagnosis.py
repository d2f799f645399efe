"""A transfer is built by the independent sender and damaged in every way: the cause must be named."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from kit import encode
from kit.judged import registry
from kit.oracle.neighbours import missing
from kit.oracle.proofs import KnownType, Part, break_at, proven
from kit.strategies import examples

from dissectors.profile import Profile, ProfileError
from dissectors.registry import Registry

if TYPE_CHECKING:
    from pathlib import Path

from analyzer.rules.diagnosis import causes, checksums
from analyzer.rules.diagnosis.causes import Cause
from analyzer.rules.diagnosis.checksums import one_bit, starts_of_all, wrong_crc
from dissectors.kit import Types
from dissectors.kit.definitions import crc_start

SIGNATURE = 0xA9AF28AEA2FBB254
OTHER = 0xC67490B59FD75681
START = crc_start(SIGNATURE)
payloads = st.binary(min_size=13, max_size=60)
# Another cause fits by chance once in 65536 attempts: always the same examples.
FIXED = examples(40, derandomize=True)


def sent(payload: bytes, transfer_id: int = 4, first: int = 0) -> list[Part]:
    """The frames of a good transfer, numbered from `first`."""
    frames = encode.Transfer("message", 1034, 10, payload, SIGNATURE, transfer_id).frames()
    return [Part(first + k, frame.data[-1], frame.data[:-1]) for k, frame in enumerate(frames)]


def numbered(parts: list[Part]) -> list[Part]:
    """The same in this order, as they would have been recorded."""
    return [part._replace(number=k) for k, part in enumerate(parts)]


def expected(payload: bytes | None = None, *lengths: tuple[int, int]) -> KnownType:
    return KnownType([START], None if payload is None else len(payload), lengths=frozenset(lengths))


def broken_sequence(parts: list[Part], around: list[Part], known: KnownType) -> Cause | None:
    """The cause that is proven, or else what is missing."""
    proof = proven(parts, around, known)
    return missing(parts, known) if proof is None else proof.cause


@FIXED
@given(payloads, st.data())
def test_one_frame_lost_is_placed(payload: bytes, data: st.DataObject) -> None:
    parts = sent(payload)
    at = data.draw(st.integers(1, len(parts) - 2))
    left = parts[:at] + parts[at + 1 :]
    cause = broken_sequence(left, [], expected(payload))
    assert cause == (causes.LOST, f" (the {causes.ordinal(at + 1)} of {len(parts)})")
    assert break_at(left) == at
    assert missing(left, KnownType([], None)) == Cause(causes.UNPROVEN)


@FIXED
@given(st.binary(min_size=40, max_size=80))
def test_several_frames_lost_are_counted_if_the_length_is_known(payload: bytes) -> None:
    parts = sent(payload)
    left = parts[:1] + parts[4:]
    assert broken_sequence(left, [], expected(payload)) == (
        causes.LOST_SEVERAL, f" (3 of {len(parts)}, from the 2nd on)",
    )  # fmt: skip
    assert broken_sequence(left, [], expected()).what == causes.LOST_ODD, "the toggles cannot tell one from three"
    usual = len(parts), len(parts[-1].body)
    assert broken_sequence(left, [], expected(None, usual)).what == causes.LOST_SEVERAL
    other = expected(None, (len(parts) - 1, usual[1]))
    assert broken_sequence(left, [], other).what == causes.LOST_ODD, "an even number more fits no toggles"
    left = [*parts[:2], *parts[3:4]]
    total = len(parts)
    assert broken_sequence(left, [], expected(payload)).detail == f" ({total - 3} of {total}, from the 3rd on)"


@FIXED
@given(payloads, st.data())
def test_neighbours_swapped_are_proven_by_the_crc(payload: bytes, data: st.DataObject) -> None:
    parts = sent(payload)
    at = data.draw(st.integers(1, len(parts) - 2))
    parts[at], parts[at + 1] = parts[at + 1], parts[at]
    came = numbered(parts)
    cut = next(k for k, part in enumerate(came) if part.end) + 1
    cause = broken_sequence(came[:cut], came[cut:], expected(payload))
    assert cause.what == causes.SWAPPED
    right = [*range(1, at + 1), at + 2, at + 1, *range(at + 3, len(parts) + 1)]
    assert cause.detail == f" (right order: {', '.join(map(str, right))})"


@given(st.permutations(range(1, 4)))
def test_any_order_of_a_few_frames_is_found(order: list[int]) -> None:
    assume(order != [1, 2, 3])
    parts = sent(bytes(range(25)))
    assert len(parts) == 4
    came = numbered([parts[0], *(parts[k] for k in order)])
    cut = next(k for k, part in enumerate(came) if part.end) + 1
    assert broken_sequence(came[:cut], came[cut:], expected()).what == causes.SWAPPED


@FIXED
@given(payloads, st.data())
def test_a_wrong_toggle_bit_needs_the_right_crc(payload: bytes, data: st.DataObject) -> None:
    parts = sent(payload)
    at = data.draw(st.integers(1, len(parts) - 1))
    parts[at] = parts[at]._replace(tail=parts[at].tail ^ 0x20)
    assert broken_sequence(parts, [], expected(payload)).what == causes.WRONG_BIT
    parts[0] = parts[0]._replace(body=bytes((parts[0].body[0] ^ 1,)) + parts[0].body[1:])
    assert broken_sequence(parts, [], expected(payload)).what == causes.NO_ORDER


@FIXED
@given(st.binary(min_size=26, max_size=60))
def test_a_copy_that_comes_later(payload: bytes) -> None:
    parts = sent(payload)
    cause = broken_sequence(numbered([*parts[:3], parts[1], *parts[3:]]), [], expected(payload))
    assert cause == (causes.REPEATED, " (too much: 4)")


@FIXED
@given(payloads, payloads)
def test_two_senders_with_one_identity(payload: bytes, other: bytes) -> None:
    """The second start restarts the transfer, then the frames of both alternate."""
    mine, theirs = sent(payload), sent((other * 5)[: len(payload)])
    assume(all(one != two for one, two in zip(mine, theirs, strict=True)))
    mixed = [part for pair in zip(mine, theirs, strict=True) for part in pair]
    came = numbered(mixed)[1:]
    cut = next(k for k, part in enumerate(came) if part.end) + 1
    assert broken_sequence(came[:cut], came[cut:], expected(payload)).what == causes.OTHER_SENDER


@FIXED
@given(payloads)
def test_a_frame_with_another_transfer_id(payload: bytes) -> None:
    parts = sent(payload)
    strange = parts[1]._replace(tail=parts[1].tail ^ 3)
    cause = broken_sequence([parts[0], *parts[2:]], [strange], expected(payload))
    assert cause == (causes.OTHER_ID, " in frame 2")


def test_too_many_frames_are_not_permuted() -> None:
    parts = sent(bytes(7 * 300))
    assert broken_sequence(parts[:5] + parts[6:], [], expected()).what == causes.LOST_ODD


def test_ordinals() -> None:
    said = [causes.ordinal(number) for number in (1, 2, 3, 4, 12, 22)]
    assert said == ["1st", "2nd", "3rd", "4th", "12th", "22nd"]


def said(joined: bytes, fits: int = SIGNATURE) -> str:
    """What is said of a transfer's bytes."""
    cause = wrong_crc(int.from_bytes(joined[:2], "little"), joined[2:], [fits], {OTHER: "vendor.Name"})
    return "" if cause is None else cause.what + cause.detail


def made(payload: bytes, signature: int | None = SIGNATURE) -> bytes:
    start = 0xFFFF if signature is None else encode.signature_crc(signature)
    return encode.crc16(payload, start).to_bytes(2, "little") + payload


@FIXED
@given(payloads)
def test_mistakes_of_a_sender_are_named(payload: bytes) -> None:
    assume(payload[-1])  # or zeros at the end might explain it too
    good = made(payload)
    assume(good[0] != good[1])
    assert said(made(payload, OTHER)) == "the signature of vendor.Name"
    assert said(made(payload, None)) == checksums.NO_SIGNATURE
    assert said(bytes((good[1], good[0])) + payload) == checksums.BYTES_SWAPPED
    assert said(payload + good[:2]) == checksums.CRC_BEHIND
    assert said(good + bytes(1)) == "zero padding: 1 zero byte at the end"
    assert said(good + bytes(6)) == "zero padding: 6 zero bytes at the end"


def test_a_flipped_bit_is_no_mistake_of_a_sender() -> None:
    good = bytearray(made(bytes(range(1, 20))))
    good[7] ^= 4
    assert said(bytes(good)) == ""


@given(st.lists(st.tuples(st.binary(max_size=40), st.integers(0, 0xFFFF)), max_size=20))
def test_crcs_run_backwards(rows: list[tuple[bytes, int]]) -> None:
    wire = [encode.crc16(payload, start) for payload, start in rows]
    begins = np.cumsum([0, *(len(payload) for payload, _ in rows)], dtype=np.int64)
    data = np.frombuffer(b"".join(payload for payload, _ in rows), np.uint8)
    assert starts_of_all(np.array(wire, np.int64), begins, data).tolist() == [start for _, start in rows]


def test_definitions_know_other_names_and_fixed_lengths() -> None:
    types = Types(registry())
    assert types.fixed_bytes(1034) == 14
    assert types.fixed_bytes(1030) is None
    assert types.fixed_bytes(20700) is None
    assert list(types.signatures(2 << 16 | 1)) == [encode.TYPES["uavcan.protocol.GetNodeInfo.Request"].signature]
    assert types.mistaken(1034)[OTHER] == "com.tmotor.esc.Status"
    assert types.mistaken(1030) == {0xA7E6EFFE18544EA3: "com.tmotor.esc.RawCommand"}
    assert types.mistaken(341) == {}
    assert types.undefined(1000) == {0x1362AB78CD12F03A: "CloudLink"}
    assert types.undefined(2 << 16 | 1000) == {}
    assert types.starting_from(START) == ["uavcan.equipment.esc.Status"]


@pytest.mark.parametrize("body", ["id = 1000", "id = 1000\nsignature = '12'", "signature = '1362AB78CD12F03A'"])
def test_a_type_without_a_definition_needs_an_id_and_a_signature(tmp_path: Path, body: str) -> None:
    (tmp_path / "profile.toml").write_text(f"[undefined.Lamp]\n{body}\n")
    with pytest.raises(ProfileError, match="signature"):
        Profile.open(tmp_path)


def test_a_type_without_a_definition_is_known_by_its_signature(tmp_path: Path) -> None:
    (tmp_path / "profile.toml").write_text("[undefined.Lamp]\nid = 20500\nsignature = '00000000000000AB'\n")
    known = Registry([Profile.open(tmp_path)])
    assert (known.undefined(0, 20500), known.undefined(1, 20500), known.undefined(0, 20501)) == ({0xAB: "Lamp"}, {}, {})


@FIXED
@given(payloads, st.data())
def test_two_frames_with_the_same_toggle_are_swapped(payload: bytes, data: st.DataObject) -> None:
    """The toggles alternate, so nothing but the CRC is wrong."""
    parts = sent(payload * 3)
    at = data.draw(st.integers(1, len(parts) - 4))
    assume(parts[at].body != parts[at + 2].body)
    parts[at], parts[at + 2] = parts[at + 2], parts[at]
    assert broken_sequence(numbered(parts), [], expected()).what == causes.SWAPPED


@FIXED
@given(payloads, st.data())
def test_a_start_or_end_bit_that_is_turned(payload: bytes, data: st.DataObject) -> None:
    parts = sent(payload)
    at = data.draw(st.integers(0, len(parts) - 1))
    bit, what = data.draw(st.sampled_from([(0x80, causes.START_BIT), (0x40, causes.END_BIT)]))
    parts[at] = parts[at]._replace(tail=parts[at].tail ^ bit)
    cut = next((k for k, part in enumerate(parts) if part.end), len(parts) - 1) + 1
    assert broken_sequence(parts[:cut], parts[cut:], expected(payload)) == (what, f" (frame {at + 1})")


@FIXED
@given(payloads)
def test_frames_in_the_opposite_order(payload: bytes) -> None:
    came = numbered(sent(payload)[::-1])
    for cut in (came[-1:], came[:1], came[1:-1]):
        rest = [part for part in came if part not in cut]
        assert broken_sequence(cut, rest, expected(payload)).what == causes.SWAPPED


@FIXED
@given(st.binary(min_size=20, max_size=80), st.data())
def test_what_is_missing_at_either_end(payload: bytes, data: st.DataObject) -> None:
    parts = sent(payload)
    total, gone = len(parts), data.draw(st.integers(1, len(parts) - 1))
    usual = expected(None, (total, len(parts[-1].body)))
    for known in (expected(payload), usual):
        first, last = missing(parts[gone:], known), missing(parts[:-gone], known)
        if gone == 1:
            assert (first, last) == (
                (causes.FIRST, f" (of {total})"), (causes.LAST, f" (the {causes.ordinal(total)} of {total})"),
            )  # fmt: skip
        else:
            assert first == (causes.FIRSTS, f" ({gone} of {total})")
            left = causes.ordinal(total - gone + 1)
            assert last == (causes.LASTS, f" (the {left} to {causes.ordinal(total)} of {total})")
    assert missing(parts[:-gone], expected()) == (causes.LASTS, f" (from the {causes.ordinal(total - gone + 1)} on)")
    assert missing(parts[gone:], expected()).what == (causes.FIRST if gone % 2 else causes.FIRSTS)


@FIXED
@given(st.binary(min_size=40, max_size=80))
def test_an_even_number_of_frames_lost_leaves_the_toggles_right(payload: bytes) -> None:
    parts = sent(payload)
    left = parts[:1] + parts[3:]
    for known in (expected(payload), expected(None, (len(parts), len(parts[-1].body)))):
        assert missing(left, known) == (causes.LOST_SEVERAL, f" (2 of {len(parts)})")
    short = len(left), len(left[-1].body)
    assert missing(left, expected(None, short)) is None, "others are as short"
    assert missing(left, expected()) is None
    assert missing(parts, expected(payload)) is None


@given(st.binary(min_size=1, max_size=80), st.integers(0, 0xFFFF), st.data())
def test_one_turned_bit_is_found(payload: bytes, start: int, data: st.DataObject) -> None:
    joined = bytearray(encode.crc16(payload, start).to_bytes(2, "little") + payload)
    at, bit = data.draw(st.integers(0, len(joined) - 1)), data.draw(st.integers(0, 7))
    joined[at] ^= 1 << bit
    difference = int.from_bytes(joined[:2], "little") ^ encode.crc16(bytes(joined[2:]), start)
    assert one_bit(difference, len(payload)) == at
    joined[at] ^= 2 << bit & 0xFF or 1
    difference = int.from_bytes(joined[:2], "little") ^ encode.crc16(bytes(joined[2:]), start)
    assert one_bit(difference, len(payload)) is None


def test_one_turned_bit_of_many_proves_nothing() -> None:
    assert one_bit(1, checksums.MOST_BYTES) == 0
    assert one_bit(1, checksums.MOST_BYTES + 1) is None
    assert checksums.BytePlace.of(0, 7) == (0, 1)
    assert checksums.BytePlace.of(15, 7) == (2, 2)
