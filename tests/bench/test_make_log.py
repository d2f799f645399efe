"""The benchmark log must be flawless where one period meets the next, or a benchmark measures error handling."""

from __future__ import annotations

import itertools
from collections import defaultdict
from typing import TYPE_CHECKING

import pytest
from bench import make_log
from kit import encode

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.slow

FIRST, LAST = 165_000, 200_000  # lines around the first seam, at 30 and at 50 Hz


@pytest.fixture(scope="module", params=[30, 50])
def lines(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    path = tmp_path_factory.mktemp("bench") / "flight.log"
    make_log.write(path, LAST, request.param)
    return path.read_text().splitlines()


def transfers(lines: list[str]) -> Iterator[tuple[int, int, bytes]]:
    """(id, transfer id, payload with CRC) of everything that begins in `lines`; any fault in the order raises."""
    parts: dict[int, list[int]] = {}
    for line in lines:
        _, _, frame = line.split(" ")
        number, data = frame.split("#")
        *body, tail = bytes.fromhex(data)
        can_id, toggles = int(number, 16), tail >> 5 & 1
        if tail & 0x80:
            assert can_id not in parts
            parts[can_id] = [0]
        if can_id not in parts:
            continue  # began before the first line
        assert toggles == parts[can_id][0] & 1
        parts[can_id][0] += 1
        parts[can_id] += body
        if tail & 0x40:
            yield can_id, tail & 31, bytes(parts.pop(can_id)[1:])


def test_the_seam_between_periods(lines: list[str]) -> None:
    assert len(lines) == LAST
    stamps = [line[1:18] for line in lines]
    assert stamps == sorted(stamps)
    assert int(stamps[-1][:10]) > make_log.START + make_log.PERIOD
    sessions = defaultdict(list)
    for can_id, transfer_id, whole in transfers(lines[FIRST:]):
        sessions[can_id].append((transfer_id, whole))
    assert len(sessions) == 1 + 9 + 3 * 8
    types = {of.type_id: of for of in encode.TYPES.values() if of.kind == "message"}
    for can_id, sent in sessions.items():
        of = types[can_id >> 8 & 0xFFFF]
        assert can_id >> 24 == 31
        for (before, old), (after, new) in itertools.pairwise(sent):
            assert (after - before) % 32 == 1
            if len(new) > 7:
                start = encode.signature_crc(of.signature)
                assert int.from_bytes(new[:2], "little") == encode.crc16(new[2:], start)
            if of.name == "PUSHCAN":
                assert int.from_bytes(new[2:6], "little") - int.from_bytes(old[2:6], "little") == 1
                assert (new[9] - old[9]) % 256 == 1
                assert new[-1] == sum(new[6:-1]) & 255
                runtime = [int.from_bytes(whole[31:33], "little") for whole in (old, new)]
                assert runtime[1] - runtime[0] in (0, 1)
            if of.name == "uavcan.protocol.NodeStatus":
                assert int.from_bytes(new[:4], "little") - int.from_bytes(old[:4], "little") == 1
            if of.name == "ParamGet":
                assert int.from_bytes(new[24:28], "little") - int.from_bytes(old[24:28], "little") == 2


def test_the_mix_is_that_of_a_flight(lines: list[str]) -> None:
    seconds = int(lines[-1][1:11]) - int(lines[0][1:11])
    assert 2300 < len(lines) / seconds < 2900
    starts = sum(int(line[-2], 16) >= 8 for line in lines)
    assert starts / len(lines) == pytest.approx(0.316, abs=0.02)
