"""A program: the command in a process with a bus of its own.

On `virtual:here` something flies as long as anybody listens. The first argument is the capture that flies, again and
again, or `-` for a bus that stays silent; the others are those of the command.
"""

from __future__ import annotations

import os
import sys
import threading
import time
import traceback
from itertools import count

from kit.command import wait_until

PAUSE = 0.005  # seconds between two handfuls of frames
HANDFUL = 10


def fly_for_ever(path: str) -> None:
    """Let it fly for ever; without it nothing would come that others wait for."""
    try:
        _fly(path)
    except BaseException:
        traceback.print_exc()
        os._exit(70)
        raise


def _fly(path: str) -> None:
    import can  # noqa: PLC0415

    with can.LogReader(path) as capture:
        frames = [message for message in capture if not message.is_error_frame]
    with can.Bus("here", interface="virtual", ignore_config=True) as bus:
        wait_until(lambda: len(bus.channel) == 2)
        for k in count():
            bus.send(frames[k % len(frames)])
            if not k % HANDFUL:
                time.sleep(PAUSE)


if __name__ == "__main__":
    from analyzer.app.process.start import alone
    from analyzer.cli import main

    alone()  # but for what flies, as a command is
    sys.modules["asammdf"] = None  # type: ignore[assignment]  # python-can imports it where it can, and a second of others
    import can.interfaces.virtual  # noqa: F401 - before two threads import it at once

    if sys.argv[1] != "-":
        threading.Thread(target=fly_for_ever, args=(sys.argv[1],), daemon=True).start()
    sys.exit(main(sys.argv[2:]))
