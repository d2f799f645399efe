"""The process that reads one MDF 4 file with asammdf: a damaged file may end it, or ask it for all memory.

`python -m analyzer.sources.python_can.mdf_child FILE` writes a `RECORD` for each message to standard output and ends
with one of the statuses below. Memory and processor time are bounded by the size of the file.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
from pathlib import Path
from struct import Struct
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing import BinaryIO

    from can import Message

RECORD = Struct("<dqqHBB64s")
"""Time in s, identifier, channel, bits of `FLAGS`, length code, bytes of data, data."""
FLAGS = (
    "is_extended_id",
    "is_remote_frame",
    "is_error_frame",
    "is_rx",
    "is_fd",
    "bitrate_switch",
    "error_state_indicator",
)
NO_CHANNEL, ODD_CHANNEL = -1, -2

WHOLE, NOT_OPENED, BROKEN_OFF, NO_LIBRARY, NO_MEMORY = 0, 10, 11, 12, 13
MEMORY, MEMORY_FACTOR = 2 << 30, 24  # bytes, and how many for each byte of the file
SECONDS, BYTES_A_SECOND = 120, 200_000


def bounds(size: int) -> tuple[int, int]:
    """Return how much memory in bytes, and processor time in seconds, a file of this size may take."""
    return MEMORY + MEMORY_FACTOR * size, SECONDS + size // BYTES_A_SECOND


def read(path: str, out: BinaryIO) -> int:
    """Write the messages of a file; return a status."""
    from can.io import mf4 as library  # noqa: PLC0415 - within the bounds

    if library.asammdf is None:  # type: ignore[attr-defined]  # what python-can itself asks
        return NO_LIBRARY
    try:
        messages = iter(library.MF4Reader(path))
    except MemoryError:
        return NO_MEMORY
    except Exception:  # noqa: BLE001 - of any type: asammdf checks little
        return NOT_OPENED
    while True:
        try:
            message = next(messages)
        except StopIteration:
            return WHOLE
        except MemoryError:
            return NO_MEMORY
        except Exception:  # noqa: BLE001 - of any type: asammdf checks little
            return BROKEN_OFF
        out.write(packed(message))


def packed(message: Message) -> bytes:
    """Return the record of a message; numbers that no frame has stay out of range."""
    channel = message.channel
    number = NO_CHANNEL if channel is None else channel if isinstance(channel, int) and channel >= 0 else ODD_CHANNEL
    flags = sum(bool(getattr(message, name)) << bit for bit, name in enumerate(FLAGS))
    size, code = min(len(message.data), 255), min(max(message.dlc, 0), 255)
    return RECORD.pack(message.timestamp, message.arbitration_id, number, flags, code, size, bytes(message.data[:64]))


def main() -> None:
    """Read the file that is named, and end without what libraries would do at the end."""
    path = sys.argv[1]
    memory, seconds = bounds(Path(path).stat().st_size)
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who started it ends it
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    with open(1, "wb", buffering=1 << 16, closefd=False) as out:
        status = read(path, out)
    os._exit(status)


if __name__ == "__main__":
    main()
