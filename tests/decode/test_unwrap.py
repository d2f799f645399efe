"""PUSH-407: a runtime of 16 bits goes on over its wraps, every unit of every node for itself."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hypothesis import example, given
from hypothesis import strategies as st
from kit import encode
from kit.strategies import examples
from kit.traffic import UNIT, Traffic, mixed

if TYPE_CHECKING:
    from collections.abc import Callable


MOTORS = "PUSHCAN.MotorStatus"


def test_runtime_goes_on_over_its_wrap_and_begins_anew_at_a_restart(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for first, second in ((65000, 7), (65535, 8), (0, 9), (40, 3), (39, 4), (60000, 5), (10, 6)):
        traffic.motor(10, runtime=first)
        traffic.motor(10, unit=0xA2, runtime=second)
    damaged = bytearray(encode.packet("PUSHCAN.MotorStatus", 9, UNIT, runtime=65000))
    damaged[10] ^= 1
    traffic.push(10, bytes(damaged))
    traffic.motor(10, runtime=3000)
    rows = decode(traffic.log).messages[MOTORS]
    one = [(row["runtime"], row["runtime.unwrapped"]) for row in rows if row["unit"] == 1]
    # A step down by one second is a restart: the wraps before it belong to another life.
    assert one[:7] == [(65000, 65000), (65535, 65535), (0, 65536), (40, 65576), (39, 39), (60000, 60000), (10, 65546)]
    assert one[7:] == [(65000, None), (3000, 68536)]
    assert [row["runtime.unwrapped"] for row in rows if row["unit"] == 2] == [7, 8, 9, 3, 4, 5, 6]


def test_what_was_read_in_the_wrong_order_is_no_part_of_the_runtime(decode: Callable[..., Any]) -> None:
    traffic = Traffic()
    for runtime in (0x01F0, 0x01FE, 0x0200, 0x0201, 0x0202):
        traffic.status(11)
        traffic.motor(11, big=True, runtime=runtime)
    assert [row["runtime.unwrapped"] for row in decode(traffic.log).messages[MOTORS][3:]] == [0x0201, 0x0202]


def test_the_unwrapped_column_says_what_it_is(decode: Callable[..., Any]) -> None:
    schema = decode(mixed().log).batches[-1].messages[MOTORS].schema
    about = schema.field("runtime.unwrapped").metadata
    assert (about[b"unit"], about[b"source"], about[b"clause"]) == (b"s", b"runtime", b"4.4.5 table 1 no 26-27")


def slowly(counters: list[int], raw: list[int], bits: int) -> list[int]:
    last: dict[int, tuple[int, int]] = {}
    out = []
    for name, value in zip(counters, raw, strict=True):
        before, wrapped = last.get(name, (value, 0))
        if before - value > 1 << bits - 1:
            wrapped += 1 << bits
        elif value < before:
            wrapped = 0
        last[name] = value, wrapped
        out.append(value + wrapped)
    return out


ROWS = st.lists(
    st.tuples(st.integers(0, 3), st.sampled_from([0, 1, 0x7FFF, 0x8000, 0x8001, 0xFFFE, 0xFFFF])), max_size=20
)


@examples(40)
@given(ROWS, st.integers(0, 4000))
@example([(0, 0xFFFF), (0, 0), (0, 0x7FFF), (0, 1)], 500)  # restarts where the batch is cut
def test_unwrapping_many_counters_at_once(
    decode: Callable[..., Any], flush: object, rows: list[tuple[int, int]], cut: int
) -> None:
    traffic = Traffic()
    for unit, runtime in rows:
        traffic.motor(10, unit=UNIT + unit, runtime=runtime)
    got = decode(traffic.log[:cut], flush, traffic.log[cut:]).messages.get(MOTORS, [])
    expected = slowly([unit for unit, _ in rows], [value for _, value in rows], 16)
    assert [row["runtime.unwrapped"] for row in got] == expected
