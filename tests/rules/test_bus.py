"""How full a bus is: bits on the wire, the seconds of a capture, and BUS-004."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from kit.encode import Frame as Sent
from kit.encode import log_line
from kit.judged import judge, registry

from analyzer import _native
from analyzer.decode.engine import Engine
from analyzer.rules.course import MOST_STEPS, Course
from analyzer.rules.view import Past
from analyzer.simulate import bits
from analyzer.tables import BRS, EXTENDED, FD, REMOTE
from dissectors.traffic import SimulatedFrame

SECOND = 10**9
START = 1_700_000_000 * SECOND


def measured(*frames: SimulatedFrame) -> list[int]:
    """Bit times as the native core counts them."""
    flags = [
        EXTENDED * one.extended | REMOTE * one.remote | FD * one.fd | BRS * one.brs | (one.dlc or 0) << 8
        for one in frames
    ]
    ends = np.cumsum([0, *(len(one.data) for one in frames)]).astype(np.int32)
    columns = np.array([one.id for one in frames], np.uint32), np.array(flags, np.uint16), ends
    data = b"".join(one.data for one in frames)
    return np.frombuffer(_native.frame_bits(*(column.tobytes() for column in columns), data), np.uint16).tolist()


@st.composite
def sent(draw: st.DrawFn) -> SimulatedFrame:
    extended, fd = draw(st.booleans()), draw(st.booleans())
    number = draw(st.integers(0, (1 << (29 if extended else 11)) - 1) | st.sampled_from((0, 0x7FF)))
    size = draw(st.sampled_from(bits.FD_LENGTHS if fd else bits.FD_LENGTHS[:9]))
    byte = st.integers(0, 255) | st.sampled_from((0, 0xFF, 0xF8, 0x07, 0x1F, 0xE0))
    data = bytes(draw(st.lists(byte, min_size=size, max_size=size)))
    if not fd and draw(st.integers(0, 9)) == 0:
        return SimulatedFrame(number, b"", extended, remote=True, dlc=size)
    return SimulatedFrame(number, data, extended, fd=fd, brs=fd and draw(st.booleans()))


@given(st.lists(sent(), max_size=20))
def test_bits_are_those_that_the_simulator_counts(frames: list[SimulatedFrame]) -> None:
    expected = []
    for one in frames:
        slow, fast = bits.flexible(one) if one.fd else (bits.classic(one), 0)
        expected.append(slow + (fast // bits.FD_SPEED if one.brs else fast))
    assert measured(*frames) == expected


def test_a_frame_of_eight_bytes_has_131_to_160_bits() -> None:
    assert measured(SimulatedFrame(0x1F040A0B, bytes.fromhex("5A" * 8)))[0] in range(131, 161)


def capture(*runs: tuple[int, int, int], bus: str = "can0") -> str:
    """Frames of 8 bytes from (start in s, count, distance in ns)."""
    times = [START + start * SECOND + k * gap for start, count, gap in runs for k in range(count)]
    return "".join(log_line(Sent(0x1F04060A, bytes.fromhex("5A" * 7 + "C0"), t, bus)) + "\n" for t in times)


def loads(text: str, step: int = 100_000) -> Course:
    past, engine, load = Past(registry(), {}), Engine(registry()), Course()
    rows = text.encode().splitlines(keepends=True)
    for at in range(0, len(rows), step):
        for batch in [*engine.feed(b"".join(rows[at : at + step])), engine.flush()]:
            load.feed(past.feed(batch))
    return load


SIZE = measured(SimulatedFrame(0x1F04060A, bytes.fromhex("5A" * 7 + "C0")))[0]


def test_seconds_begin_with_the_capture() -> None:
    text = capture((0, 100, 1_000_000), (2, 50, 1_000_000))
    for step in (7, 100_000):
        load = loads(text, step)
        assert (load.start, load.step) == (START, SECOND)
        assert load.frames(0) == (100, 0, 50)
        assert load.bits(0) == (100 * SIZE, 0, 50 * SIZE)


def test_interfaces_are_counted_apart() -> None:
    load = loads(capture((0, 10, 1_000_000)) + capture((1, 20, 1_000_000), bus="can1"))
    assert [load.frames(bus) for bus in range(3)] == [(10, 0), (0, 20), ()]
    assert load.bits(2) == ()


def test_steps_widen_when_there_are_too_many() -> None:
    text = capture(*((at * 3, 1, 1) for at in range(MOST_STEPS)))
    load = loads(text)
    assert (load.start, load.step) == (START, 4 * SECOND)
    assert (sum(load.frames(0)), sum(load.bits(0))) == (MOST_STEPS, MOST_STEPS * SIZE)
    assert len(load.frames(0)) <= MOST_STEPS


def test_loads_above_the_limits() -> None:
    rate = 1000 * SIZE  # 1000 frames are a full second
    text = capture((0, 500, 1_000_000), (1, 510, 1_000_000), (2, 710, 1_000_000), (3, 100, 1_000_000))
    said = judge(text, ("BUS-004",), bit_rate=rate)
    assert [(one.text, one.frames, one.severity) for one in said] == [
        ("load 51 %, limit 50 %", (501,), "note"),
        ("load 71 %, limit 70 %", (1011,), "note"),
    ]
    assert judge(text, ("BUS-004",), step=7, bit_rate=rate) == said


def test_the_last_second_counts_too() -> None:
    assert len(judge(capture((0, 800, 1_000_000)), ("BUS-004",), bit_rate=1000 * SIZE)) == 1


def test_without_a_bit_rate_there_is_no_load() -> None:
    assert judge(capture((0, 800, 1_000_000)), ("BUS-004",)) == []


def test_a_second_that_the_clock_shows_twice_is_not_twice_as_full() -> None:
    text = capture((0, 400, 1_000_000), (0, 400, 1_000_000), (1, 400, 1_000_000))
    for step in (None, 7, 400, 450):
        assert judge(text, ("BUS-004",), step, bit_rate=1000 * SIZE) == []
    lines = capture((0, 600, 1_000_000)).splitlines(keepends=True)
    mixed = "".join(line for k in range(0, 600, 2) for line in (lines[k + 1], lines[k]))  # another order only
    for step in (None, 7):
        assert len(judge(mixed, ("BUS-004",), step, bit_rate=1000 * SIZE)) == 1
