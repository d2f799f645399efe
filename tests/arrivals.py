"""Buses of python-can: what has arrived on one, and one that fails."""

from __future__ import annotations

import can

Arrival = tuple[int, bool, bool, bytes]


def got(bus: can.BusABC) -> list[Arrival]:
    """Identifier, whether it has 29 bits, whether it asks for data, data; of all that has come by now."""
    messages = iter(lambda: bus.recv(0), None)
    return [(m.arbitration_id, m.is_extended_id, m.is_remote_frame, bytes(m.data)) for m in messages if m is not None]


class Failing(can.BusABC):
    """Sends so many frames, and then says why not."""

    protocol = can.CanProtocol.CAN_20

    def __init__(self, most: int, error: Exception) -> None:
        super().__init__("x")
        self.most, self.error, self.sent = most, error, 0

    def send(self, *_: object) -> None:
        if self.sent == self.most:
            raise self.error
        self.sent += 1

    def shutdown(self) -> None:
        super().shutdown()
        raise RuntimeError
