"""An interface as a stream of rows: what the parts that receive have in common, and which of them it takes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from analyzer._native import FrameBatch
    from analyzer.live.interfaces.filters import Filters
    from analyzer.live.interfaces.naming import Interface


class Receiver(Protocol):
    """One open interface. All methods but `wake` and `notes` are called by one thread at a time."""

    name: str
    """The name that a person gives it, and the only bus of its rows."""
    failed: str | None
    """Why it cannot go on; `receive` then gives what is left and then None at once."""

    def receive(self, seconds: float) -> FrameBatch | None:
        """Return the next rows, after waiting for them at most so long. Does not raise."""

    def finish(self) -> list[FrameBatch]:
        """Return the rows that are still there at the end."""

    def wake(self) -> None:
        """End the wait of the thread that receives, if it can be ended."""

    def notes(self) -> list[str]:
        """Return the lines that are new for people, with the name of the interface in front."""

    def close(self) -> None:
        """Let go of the interface."""


def open_receiver(interface: Interface, filters: Filters, *, hardware: bool = False) -> Receiver:
    """Open an interface for receiving alone. Raises `InterfaceError` with one line that says why it cannot be.

    `hardware` asks a SocketCAN controller for its own time stamps.
    """
    if interface.kind == "socketcan":
        from analyzer.live.interfaces.socketcan import SocketCanReceiver  # noqa: PLC0415 - its native part is for Linux only

        return SocketCanReceiver(interface, filters, hardware=hardware)
    from analyzer.live.interfaces.drivers import DriverReceiver  # noqa: PLC0415 - only what is needed

    return DriverReceiver(interface, filters)
