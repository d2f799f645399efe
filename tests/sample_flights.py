"""The sample captures that `tailbyte simulate` makes: for each file the arguments that make it."""

from __future__ import annotations

import contextlib
import io
import shlex
from typing import TYPE_CHECKING

from analyzer.cli import main

if TYPE_CHECKING:
    from pathlib import Path

# Ten faults in one mission: two of single frames, four of transfers, one value, two of packets, one hot ESC.
TEN = (
    "CAN-002@2.1 CAN-005@2.3:node=13 TRF-003@2.5:node=12 TRF-004@2.7:node=16 TRF-010@2.9:node=14 TRF-016@3.2:node=15 "
    "TYP-302@3.3:node=17 PUSH-005@3.5:node=11 PUSH-009@3.7:node=18 TYP-305@1.5:node=13:seconds=2"
)
FLIGHTS = {
    "hover-4.log": "--esc 4 --duration 5 --seed 4",
    "mission-8-faults.log": "--profile mission --esc 8 --duration 4.5 --seed 8 "
    + " ".join(f"--fault {fault}" for fault in TEN.split()),
    "startup.log": "--profile startup --duration 5",
    "esc-failure.mcap": "--scenario esc-failure --duration 8.5",
    "command-loss.log": "--scenario command-loss --duration 5 --esc 3",
    "bus-break.log": "--scenario bus-break --duration 6",
    "reordering.log": "--scenario reordering --duration 4",
    "duplicate-node.log": "--scenario duplicate-node --duration 3",
    "pack-sag.log": "--scenario pack-sag --duration 7 --esc 3",
    "recording-ends.log": "--scenario recording-ends --duration 5",
}


def key_of(capture: Path) -> Path:
    """Where the answer key of a capture lies."""
    return capture.with_suffix(".key.json")


def fly(name: str, folder: Path) -> None:
    """Makes one capture and its key in `folder`. Raises `RuntimeError` with what the command says if it cannot."""
    path, said = folder / name, io.StringIO()
    with contextlib.redirect_stderr(said):
        status = main(["simulate", *shlex.split(FLIGHTS[name]), "-o", str(path), "--key", str(key_of(path))])
    if status:
        raise RuntimeError(f"{name}: {said.getvalue()}")
