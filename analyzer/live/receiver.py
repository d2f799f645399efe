"""An interface as a stream of rows: what the parts that receive have in common, and which of them it takes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from analyzer._native import Piece
    from analyzer.live.filters import Filters
    from analyzer.live.interfaces import Interface


class Receiver(Protocol):
    """One open interface. All methods but `wake` and `notes` are called by one thread at a time."""

    name: str
    """What a person calls it, and the only bus of its rows."""
    failed: str | None
    """Why it cannot go on; `receive` then gives what is left and then None at once."""

    def receive(self, seconds: float) -> Piece | None:
        """The next rows, after waiting for them at most so long. Does not raise."""

    def finish(self) -> list[Piece]:
        """What is still there at the end."""

    def wake(self) -> None:
        """Ends the wait of the thread that receives, if it can be ended."""

    def notes(self) -> list[str]:
        """What is new for people, a line each, with the name of the interface in front."""

    def close(self) -> None:
        """Lets go of the interface."""


def open_receiver(interface: Interface, filters: Filters, *, hardware: bool = False) -> Receiver:
    """Opens an interface for receiving alone. Raises `InterfaceError` with one line that says why it cannot be.

    `hardware` asks a SocketCAN controller for its own time stamps.
    """
    if interface.kind == "socketcan":
        from analyzer.live.socketcan import SocketCan  # noqa: PLC0415 - its native part is for Linux only

        return SocketCan(interface, filters, hardware=hardware)
    from analyzer.live.buses import Bus  # noqa: PLC0415 - only what is needed

    return Bus(interface, filters)
