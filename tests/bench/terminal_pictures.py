"""Takes pictures of the monitor as it looks in sessions that are simulated, in several sizes of the terminal.

    python tests/bench/terminal_pictures.py DIRECTORY [SCENE ...]     # SVG, and PNG where a Chromium is installed

To be run after every change of the layout: look at the pictures.
"""

from __future__ import annotations

import argparse
import asyncio
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from kit.judged import registry

from analyzer.board.board import Board
from analyzer.board.snapshot import RecordingState
from analyzer.terminal.app import Monitor

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from kit.judged import judge
from kit.monitor import Script, batches, capture, trouble
from kit.simulated import faulted

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.board.snapshot import Snapshot

SIZES = ((80, 24), (60, 24), (132, 40), (200, 50))
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FAULTS = ("TYP-305@2:bit=5", "TRF-003@2.2", "BUS-007@2.5", "TRF-010@3", "BUS-028@2.8")
MS = 1_000_000


def session(text: bytes, *, problem: str = "", lost: int = 0, after: int = 10 * MS, judged: bool = True) -> Snapshot:
    """The end of a session that saw and judged a text."""
    board, now = Board(registry(), {"can0": 1_000_000}), 0
    for batch in batches(text):
        now = batch.frames.column("t")[-1].value if len(batch.frames) else now
        board.feed(batch, now)
    if judged:
        found = [one for one in judge(text) if one.severity != "note"]
        board.take_findings(
            (trouble(one.rule, one.severity, node=one.node, type=one.type, text=one.text, t=now) for one in found),
            now,
        )
    board.take_counts("can0", 1_234_567, lost, 0)
    if lost:
        board.note("can0: link down", now - 3_000 * MS)
        board.note("can0: link up", now - 1_000 * MS)
    board.take_recording(RecordingState("flights/2026-03-14-a.mcap", 12_345_678, 1_234_567, 0, problem))
    return board.snapshot(now + after)


SCENES: dict[str, tuple[Callable[[], Snapshot], tuple[str, ...]]] = {
    "four": (lambda: session(capture("hover-4.log")), ()),
    "eight-faults": (lambda: session(faulted(*FAULTS, escs=8).text.encode()), ()),
    "twenty": (lambda: session(faulted(escs=20, seconds=3.0).text.encode()), ()),
    "bus-break": (lambda: session(capture("bus-break.log"), lost=17), ("l",)),
    "silent": (lambda: session(capture("command-loss.log"), after=12_000 * MS, problem="no space left"), ()),
    "nothing": (lambda: Board(registry(), {"can0": None}).snapshot(1_773_475_330_000 * MS), ()),
    "max-sorted": (lambda: session(faulted(*FAULTS, escs=8).text.encode()), ("x", "x", "s", "s", "S")),
    "nodes": (lambda: session(faulted(*FAULTS, escs=8).text.encode()), ("n", "space")),
    "units": (lambda: session(faulted(*FAULTS, escs=8).text.encode()), ("e",)),
    "help": (lambda: session(capture("hover-4.log")), ("question_mark",)),
}


async def picture(state: Snapshot, keys: tuple[str, ...], size: tuple[int, int]) -> str:
    app = Monitor(Script([state]))
    async with app.run_test(size=size) as pilot:
        await pilot.pause()
        await pilot.press(*keys)
        await pilot.pause()
        return app.export_screenshot(title="tailbyte live can0")


def drawn(svg: Path) -> None:
    """The picture as PNG, if there is a browser to draw it."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser:
        options = ("--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=2500,1300")
        goal = svg.with_suffix(".png")
        command = [browser, *options, f"--screenshot={goal}", svg.resolve().as_uri()]
        subprocess.run(command, check=True, capture_output=True, timeout=120)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directory", type=Path)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(SCENES)}")
    args = parser.parse_args()
    if unknown := set(args.scenes) - set(SCENES):
        parser.error(f"no such scene: {', '.join(sorted(unknown))}")
    args.directory.mkdir(parents=True, exist_ok=True)
    for scene in args.scenes or SCENES:
        make, keys = SCENES[scene]
        state = make()
        for size in SIZES:
            goal = args.directory / f"{scene}-{size[0]}x{size[1]}.svg"
            goal.write_text(asyncio.run(picture(state, keys, size)))
            drawn(goal)
            sys.stdout.write(f"{goal}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
