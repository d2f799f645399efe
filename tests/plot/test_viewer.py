"""Recordings on their way to a viewer: what arrives, and viewers that are absent, hung, closed or no viewers at all."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest
from kit.command import wait_until
from kit.pictures import deaf, keeper, taken

from analyzer.plot import chunks
from analyzer.plot import viewer_program as plot_viewer
from analyzer.plot.address import Address
from analyzer.plot.moments import Moments, PlotClock
from analyzer.plot.viewer import MOST_WAITING, ViewerOutput
from analyzer.sinks.atomic import TargetError

if TYPE_CHECKING:
    from pathlib import Path

ROWS = 50_000


def points(k: int, rows: int = ROWS) -> list[chunks.Chunk]:
    steps = np.arange(k * rows, (k + 1) * rows, dtype=np.int64)
    return chunks.scalars([("/a", steps.astype(np.float64))], Moments(steps, steps + 1), PlotClock(0))


def looks() -> list[chunks.Chunk]:
    return chunks.styled([chunks.line_style("/a", "a", 0xFF, 1.0)])


@pytest.mark.slow
@pytest.mark.parametrize("waits", [True, False])
def test_a_viewer_gets_everything(tmp_path: Path, *, waits: bool) -> None:
    with keeper(tmp_path) as (address, kept):
        with ViewerOutput(address, "x", waits=waits) as output:
            output.send(looks())
            for k in range(5):
                output.send(points(k))
        assert (output.dropped, output.problem) == (0, None)
        wait_until(lambda: len(taken(kept).values("/a")) == 5 * ROWS)
    got = taken(kept)
    assert got.values("/a") == [float(k) for k in range(5 * ROWS)]
    assert got.static["/a"]["SeriesLines:names"] == ["a"]


def test_an_absent_viewer_is_said_at_once_or_counted() -> None:
    port = plot_viewer.free_port("127.0.0.1")
    address = Address("rerun+http", "127.0.0.1", port)
    with pytest.raises(TargetError, match=f"127.0.0.1:{port}/proxy: no viewer is there"), ViewerOutput(address, "x"):
        pass
    with ViewerOutput(address, "x", waits=False) as live:
        live.send(points(0))
        live.send(points(1))
    assert live.dropped == 2 * ROWS
    assert "no viewer is there" in str(live.problem)


def test_a_viewer_that_closes_is_said_or_counted() -> None:
    def fill(address: Address) -> None:
        with ViewerOutput(address, "x") as output:
            for k in range(3 * MOST_WAITING // ROWS):
                output.send(points(k))

    with deaf(closes=True) as address:
        with pytest.raises(TargetError, match="closed the connection"):
            fill(address)
        with ViewerOutput(address, "x", waits=False) as live:
            for k in range(4):
                live.send(points(k))
        assert live.dropped == 4 * ROWS
        assert live.problem == "the viewer has closed the connection"


@pytest.mark.slow
def test_a_hung_viewer_is_given_up_by_who_waits() -> None:
    def fill(address: Address) -> None:
        with ViewerOutput(address, "x", patience=0.1) as output:
            for k in range(3 * MOST_WAITING // ROWS):
                output.send(points(k))

    with deaf() as address, pytest.raises(TargetError, match=r"has taken nothing|does not answer"):
        fill(address)


@pytest.mark.slow
def test_a_hung_viewer_costs_what_has_no_room_and_nothing_else() -> None:
    """The rows that wait are bounded, the looks of what is to come are kept."""
    many = 3 * MOST_WAITING // ROWS
    with deaf() as address:
        with ViewerOutput(address, "x", waits=False) as live:
            for k in range(many):
                live.send(points(k))
            assert live._rows <= MOST_WAITING
            assert live.dropped >= (many * ROWS) - MOST_WAITING
            before = live.dropped
            live.send(looks())
            assert live.dropped == before
        assert live.dropped > before  # what waited when the block ended is lost, too
        assert "in time" in str(live.problem)


PROGRAM = """
import sys
import numpy as np
from analyzer.plot import chunks
from analyzer.plot.address import Address
from analyzer.plot.moments import Moments, PlotClock
from analyzer.plot.viewer import ViewerOutput
steps = np.arange(500_000)
with ViewerOutput(Address.parse(sys.argv[1]), "x", waits=False) as live:
    live.send(chunks.scalars([("/a", steps.astype(float))], Moments(steps, steps + 1), PlotClock(0)))
print(live.problem)
"""


@pytest.mark.slow
def test_a_program_ends_although_its_viewer_hangs() -> None:
    with deaf() as address:
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, str(address.port)], capture_output=True, timeout=60, check=True
        )
    assert b"in time" in done.stdout


@pytest.mark.parametrize(
    ("text", "whole"),
    [
        ("9877", "rerun+http://127.0.0.1:9877/proxy"),
        ("host", "rerun+http://host:9876/proxy"),
        ("host:1", "rerun+http://host:1/proxy"),
        ("[::1]:2", "rerun+http://[::1]:2/proxy"),
        ("rerun+http://127.0.0.1:9876/proxy", "rerun+http://127.0.0.1:9876/proxy"),
        ("rerun+https://a.b:3/", "rerun+https://a.b:3/proxy"),
    ],
)
def test_addresses(text: str, whole: str) -> None:
    assert str(Address.parse(text)) == whole


@pytest.mark.parametrize(
    "text", ["", "0", "70000", "http://a", "a:b", "a/b", "rerun+http://a:1/other", "a b", "flight.log "]
)
def test_no_addresses(text: str) -> None:
    with pytest.raises(ValueError, match="no viewer's address"):
        Address.parse(text)
