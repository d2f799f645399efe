"""The interfaces that there are: those of the kernel, and what the drivers of python-can find."""

from __future__ import annotations

import os
import queue
import sys
import time
import warnings
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

import can

from analyzer.live.interfaces import links
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator

# Seconds for all drivers together.
PATIENCE = 3.0
# The kernel knows its own interfaces better; virtual ones exist in one process alone; and finding those of the network
# would listen to it for seconds.
_LEFT_OUT = ("socketcan", "virtual", "socketcand", "udp_multicast")


@dataclass(frozen=True, slots=True)
class ListedInterface:
    """An interface: `name` is what a command takes for it, `link` what the kernel says of its own ones."""

    name: str
    link: links.Link | None = None


def list_interfaces() -> list[ListedInterface]:
    """List all interfaces; those of the kernel come first."""
    return [*list_kernel(), *find_devices()]


def list_kernel() -> list[ListedInterface]:
    """List the SocketCAN interfaces of this network namespace; none where the kernel cannot be asked."""
    try:
        return [ListedInterface(link.name, link) for link in links.list_links()]
    except OSError:
        return []


def find_devices() -> list[ListedInterface]:
    """List what python-can's drivers find within `PATIENCE` seconds, by name; keep what they print away."""
    kinds = sorted(can.VALID_INTERFACES.difference(_LEFT_OUT))
    done: queue.SimpleQueue[list[ListedInterface]] = queue.SimpleQueue()
    found: list[ListedInterface] = []
    with _silence(), suppress(queue.Empty):
        end = time.monotonic() + PATIENCE
        for kind in kinds:  # daemons: the interpreter waits for no driver that hangs
            Thread(target=_detect, args=(kind, done), name=kind, daemon=True).start()
        for _ in kinds:
            found += done.get(timeout=max(0.0, end - time.monotonic()))
    return sorted(found, key=lambda listed: listed.name)


def _detect(kind: str, done: queue.SimpleQueue[list[ListedInterface]]) -> None:
    found: list[ListedInterface] = []
    with suppress(Exception):  # each driver fails in its own way
        found = [ListedInterface(f"{kind}:{config['channel']}") for config in can.detect_available_configs([kind])]
    done.put(found)


@contextmanager
def _silence() -> Iterator[None]:
    """Keep quiet what libraries of drivers write to the descriptors themselves."""
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
