"""A live session in a viewer that is not there, that goes, or that takes all of it."""

from __future__ import annotations

import subprocess
from typing import TYPE_CHECKING

import pytest
from kit.command import BUS, CAPTURES, LIMIT, Reader, start_with_bus, wait_until
from kit.pictures import keeper, taken

from analyzer.plot import viewer_program as plot_viewer

if TYPE_CHECKING:
    from pathlib import Path

HOVER = CAPTURES / "hover-4.log"
PIPE = subprocess.PIPE
with_viewer = pytest.mark.skipif(plot_viewer.binary() is None, reason="there is no viewer of Rerun here")


@pytest.mark.slow
def test_nobody_there(tmp_path: Path) -> None:
    """It is said once, and the session goes on."""
    url = f"rerun+http://127.0.0.1:{plot_viewer.free_port('127.0.0.1')}/proxy"
    record = tmp_path / "x.log"
    with start_with_bus(
        HOVER, "live", BUS, "-q", "-w", record, "-c", 3000, "--plot", url, stdout=PIPE, stderr=PIPE
    ) as live:
        _, err = live.communicate(timeout=LIMIT)
    assert err.count(b"-- the viewer gets no more: ") == 1
    assert b"Traceback" not in err
    assert record.read_bytes().count(b"\n") == 3000


@pytest.mark.slow
def test_no_display() -> None:
    env = {"DISPLAY": "", "WAYLAND_DISPLAY": ""}
    with start_with_bus("-", "live", BUS, "-q", "--plot", env=env, stdout=PIPE, stderr=PIPE) as live:
        out, err = live.communicate(timeout=LIMIT)
    assert (live.returncode, out) == (3, b"")
    assert err == b"tailbyte: --plot: there is no display for a viewer: give the URL of one\n"


@pytest.mark.slow
@with_viewer
def test_it_has_what_was_on_the_bus(tmp_path: Path) -> None:
    with keeper(tmp_path) as (address, kept):
        args = ("live", BUS, "-q", "-c", 3000, "--plot", str(address))
        with start_with_bus(HOVER, *args, stdout=PIPE, stderr=PIPE) as live:
            _, err = live.communicate(timeout=LIMIT)
        assert b"the viewer" not in err
        wanted = {"/voltage/esc1", "/speed/esc4", "/events/calm", "/events/calm/speed/esc1"}
        wait_until(lambda: wanted <= set(taken(kept).rows))


@pytest.mark.slow
@with_viewer
def test_one_that_goes_away_ends_nothing_but_the_plot(tmp_path: Path) -> None:
    record = tmp_path / "x.log"
    args = ("live", BUS, "-q", "-w", record, "--plot")
    with keeper(tmp_path) as (address, _):
        live = start_with_bus(HOVER, *args, str(address), stdout=PIPE, stderr=PIPE)
        wait_until(lambda: record.exists() and record.read_bytes().count(b"\n") > 500)
    assert live.stderr is not None
    with live:
        told = Reader(live.stderr.fileno())
        told.until(b"-- the viewer gets no more: ")
        before = record.read_bytes().count(b"\n")
        wait_until(lambda: record.read_bytes().count(b"\n") > before + 500)
        live.terminate()
        rest = told.rest()
        assert live.wait(LIMIT) in {0, 1, 4}
    assert b" received + 0 dropped, as far as its driver tells\n" in rest
    assert b"Traceback" not in rest
