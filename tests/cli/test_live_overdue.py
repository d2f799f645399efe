"""On a silent bus the clock ends transfers, for whoever looks; the rules still go by the times of frames."""

from __future__ import annotations

from typing import Any

import pytest
from kit.command import START
from kit.judged import registry

from analyzer.app.live.overdue import Overdue
from analyzer.decode.engine import Engine
from analyzer.rules.checking import Check
from analyzer.rules.settings import Settings

MS = 1_000_000
SECOND = 1000 * MS
FIRST, MIDDLE, LAST = "55AA010203040580", "0607080910111220", "13141560"


class Bus:
    """Frames of node 11 that reach a view, and a clock."""

    def __init__(self) -> None:
        self.now = 0
        self.told: list[str] = []
        self.view = Overdue(self.told.append, lambda: self.now)
        self._engine, self._check = Engine(registry()), Check(registry(), Settings())

    def send(self, at_ms: int, data: str, id_: str = "1004060B") -> None:
        self.now = at_ms * MS
        t = START + self.now
        batches = [*self._engine.feed(f"({t // SECOND}.{t % SECOND:09d}) can0 {id_}#{data}\n".encode())]
        for measured in self._check.measured([*batches, self._engine.flush()]):
            self.view.batch(measured)

    def look(self, at_ms: int) -> list[str]:
        self.now = at_ms * MS
        before = len(self.told)
        session: Any = None
        self.view.look(session)
        return self.told[before:]


@pytest.fixture
def bus() -> Bus:
    one = Bus()
    for k in range(4):  # until the node is believed
        for n, data in enumerate((FIRST, MIDDLE, LAST)):
            one.send(10 * k + n, data[:-2] + f"{int(data[-2:], 16) | k:02X}")
    return one


def test_a_transfer_without_an_end_is_told_once(bus: Bus) -> None:
    bus.send(100, FIRST[:-2] + "84")
    assert bus.look(2099) == []
    assert bus.look(2101) == ["silence: 1 transfer timed out, of can0 node 11"]
    assert bus.look(9000) == []
    for node in range(5):
        bus.send(9100, FIRST[:-2] + "85", f"1004060{node + 11:X}")
    assert bus.look(9200) == []


def test_one_that_ends_in_time_is_not(bus: Bus) -> None:
    bus.send(100, FIRST[:-2] + "84")
    bus.send(101, MIDDLE[:-2] + "24")
    bus.send(102, LAST[:-2] + "44")
    assert bus.look(9000) == []


def test_a_bus_that_goes_on_closes_it_by_its_frames(bus: Bus) -> None:
    bus.send(100, FIRST[:-2] + "84")
    bus.send(2500, "00C5")
    assert bus.look(2600) == []


def test_nothing_at_all_is_nothing() -> None:
    assert Bus().look(5000) == []
