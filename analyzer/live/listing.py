"""The interfaces that there are: those of the kernel, and what the drivers of python-can find."""

from __future__ import annotations

import os
import queue
import sys
import time
import warnings
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

import can

from analyzer.live import links

if TYPE_CHECKING:
    from collections.abc import Iterator

# Seconds for all drivers together.
PATIENCE = 3.0
# The kernel knows its own interfaces better; virtual ones exist in one process alone; and finding those of the network
# would listen to it for seconds.
_LEFT_OUT = ("socketcan", "virtual", "socketcand", "udp_multicast")


@dataclass(frozen=True, slots=True)
class Listed:
    """An interface: `name` is what a command takes for it, `link` what the kernel says of its own ones."""

    name: str
    link: links.Link | None = None


def found() -> list[Listed]:
    """All of them; those of the kernel come first."""
    return [*kernel(), *drivers()]


def kernel() -> list[Listed]:
    """The SocketCAN interfaces of this network namespace; none where the kernel cannot be asked."""
    try:
        return [Listed(link.name, link) for link in links.links()]
    except OSError:
        return []


def drivers() -> list[Listed]:
    """What python-can's drivers find within `PATIENCE` seconds, by name; what they print on the way is kept away."""
    kinds = sorted(can.VALID_INTERFACES.difference(_LEFT_OUT))
    done: queue.SimpleQueue[list[Listed]] = queue.SimpleQueue()
    found: list[Listed] = []
    with _silence(), suppress(queue.Empty):
        end = time.monotonic() + PATIENCE
        for kind in kinds:  # daemons: the interpreter waits for no driver that hangs
            Thread(target=_detect, args=(kind, done), name=kind, daemon=True).start()
        for _ in kinds:
            found += done.get(timeout=max(0.0, end - time.monotonic()))
    return sorted(found, key=lambda listed: listed.name)


def _detect(kind: str, done: queue.SimpleQueue[list[Listed]]) -> None:
    found: list[Listed] = []
    with suppress(Exception):  # each driver fails in its own way
        found = [Listed(f"{kind}:{config['channel']}") for config in can.detect_available_configs([kind])]
    done.put(found)


@contextmanager
def _silence() -> Iterator[None]:
    """Libraries of drivers write to the descriptors themselves."""
    with ExitStack() as stack:
        nowhere = stack.enter_context(Path(os.devnull).open("w"))
        for stream, descriptor in ((sys.stdout, 1), (sys.stderr, 2)):
            stream.flush()
            kept = os.dup(descriptor)
            stack.callback(os.close, kept)
            stack.callback(os.dup2, kept, descriptor)
            os.dup2(nowhere.fileno(), descriptor)
        for context in (redirect_stdout(nowhere), redirect_stderr(nowhere), warnings.catch_warnings()):
            stack.enter_context(context)
        warnings.simplefilter("ignore")
        yield
