"""`tailbyte` in a process with a bus of its own: on `virtual:here` something flies as long as anybody listens.

Run as a program with the arguments of the command; the first one is the capture that flies, again and again, or `-`
for a bus that stays silent.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
import traceback
from itertools import count
from typing import TYPE_CHECKING, Any

import can

from kit import ROOT, TESTS
from kit.command import environment, wait_until

if TYPE_CHECKING:
    from collections.abc import Mapping

BUS = "virtual:here"
PAUSE = 0.005  # seconds between two handfuls of frames
HANDFUL = 10


def started(*args: object, env: Mapping[str, str] | None = None, **more: Any) -> subprocess.Popen[bytes]:
    """The process; `args` as above."""
    path = os.pathsep.join(map(str, (ROOT, TESTS)))
    own = environment({"PYTHONPATH": path, "CAN_CONFIG": "{}"} | dict(env or {}))
    return subprocess.Popen([sys.executable, __file__, *map(str, args)], env=own, **more)


def fly(path: str) -> None:
    """Let it fly for ever; without it nothing would come that others wait for."""
    try:
        _fly(path)
    except BaseException:
        traceback.print_exc()
        os._exit(70)
        raise


def _fly(path: str) -> None:
    with can.LogReader(path) as log:
        frames = [message for message in log if not message.is_error_frame]
    with can.Bus("here", interface="virtual", ignore_config=True) as bus:
        wait_until(lambda: len(bus.channel) == 2)
        for k in count():
            bus.send(frames[k % len(frames)])
            if not k % HANDFUL:
                time.sleep(PAUSE)


if __name__ == "__main__":
    from analyzer.cli import main

    if sys.argv[1] != "-":
        threading.Thread(target=fly, args=(sys.argv[1],), daemon=True).start()
    sys.exit(main(sys.argv[2:]))
