"""Takes pictures of what `tailbyte plot` makes of simulated flights: of every tab, in Rerun's viewer without a window.

    python tests/bench/plot_pictures.py DIRECTORY [FLIGHT ...]     # the tabs of all flights, or of some
    python tests/bench/plot_pictures.py --readme                   # tests/bench/plot.png, which the README shows

It needs a graphics driver for Vulkan, one in software will do (Debian: mesa-vulkan-drivers and libvulkan1), and is to
be run after every change of the layout: look at the pictures.
"""

from __future__ import annotations

import argparse
import io
import re
import sys
import tempfile
from pathlib import Path

from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench.headless import viewer
from kit.command import run

README = Path(__file__).with_name("plot.png")
MOST_BYTES = 300_000
SIZE = "1600x1110"
MENU = 36  # its height in pixels; it is empty
FAULTS = (
    "TYP-305@20:bit=5", "TRF-003@22", "TYP-306@25", "BUS-007@30", "BUS-028@35", "TRF-005@41", "TRF-010@42",
    "BUS-025@45", "BUS-004@50", "CAN-015@12",
)  # fmt: skip
FLIGHTS: dict[str, list[str]] = {
    "four": ["--esc", "4", "--duration", "60"],
    "eight-faults": ["--esc", "8", "--duration", "60", "--seed", "5"] + [f"--fault={fault}" for fault in FAULTS],
    "one": ["--esc", "1", "--duration", "30"],
    "twenty": ["--esc", "20", "--duration", "40"],
    "no-escs": ["--esc", "4", "--duration", "30"],
}
# Frames of the autopilot and of the ground station, but no throttle commands.
OF_OTHERS = re.compile(r" 1(?!F0406)[0-9A-F]{5}(0A|7D)#")


def recording(flight: str, directory: Path) -> Path:
    """A flight as a recording for the viewer."""
    log = directory / f"{flight}.log"
    _tailbyte("simulate", "-o", log, "--flight", "mission", *FLIGHTS[flight])
    if flight == "no-escs":
        log.write_text("".join(line for line in log.read_text().splitlines(keepends=True) if OF_OTHERS.search(line)))
    _tailbyte("plot", log)
    return log.with_suffix(".rrd")


def _tailbyte(*args: object) -> None:
    done = run(*args)
    if done.returncode:
        sys.exit(done.stderr.decode())


def every_tab(flights: list[str], goal: Path) -> int:
    """Pictures of all tabs; the number of complaints of views."""
    complaints = 0
    goal.mkdir(parents=True, exist_ok=True)
    for flight in flights:
        with tempfile.TemporaryDirectory() as directory:
            made = recording(flight, Path(directory))
            with viewer(goal / "viewer.txt") as shown:
                shown.open(made)
                for tab in shown.tabs():
                    shown.show(tab)
                    name = re.sub(r"[^\w.-]+", "_", "-".join((flight, *tab)))
                    (goal / f"{name}.png").write_bytes(shown.settle())
                    told = shown.complaints()
                    complaints += len(told)
                    sys.stdout.write("\n  ".join((name, *told)) + "\n")
    return complaints


def for_readme() -> None:
    """The overview of the flight with faults, in few colours."""
    with tempfile.TemporaryDirectory() as directory:
        made = recording("eight-faults", Path(directory))
        with viewer(Path(directory) / "viewer.txt", SIZE) as shown:
            shown.open(made, bare=True)
            shown.show(("Overview",))
            image = Image.open(io.BytesIO(shown.settle())).convert("RGB")
    image = image.crop((0, MENU, *image.size))
    image.quantize(128, dither=Image.Dither.NONE).save(README, optimize=True)
    if README.stat().st_size > MOST_BYTES:
        sys.exit(f"{README} is larger than {MOST_BYTES} bytes")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directory", nargs="?", type=Path)
    parser.add_argument("flights", nargs="*", metavar="FLIGHT", help=f"of {', '.join(FLIGHTS)}")
    parser.add_argument("--readme", action="store_true")
    args = parser.parse_args()
    if unknown := set(args.flights) - set(FLIGHTS):
        parser.error(f"no such flight: {', '.join(sorted(unknown))}")
    if args.readme:
        for_readme()
    if args.directory:
        return int(every_tab(args.flights or list(FLIGHTS), args.directory) > 0)
    return 0


if __name__ == "__main__":
    sys.exit(main())
