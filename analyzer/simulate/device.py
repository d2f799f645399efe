"""A device on the bus: its transfer IDs, NodeStatus once in a while, its answer to GetNodeInfo."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.traffic import LOWEST, Sending, next_id

if TYPE_CHECKING:
    from random import Random

    from dissectors.traffic import Values, World

# DroneCAN allows up to a second between two; half of it survives a loss.
STATUS_PERIOD = 500 * MILLISECOND
_THINKING = 300_000  # ns until a device answers


class Device:
    """One node ID and what it says of itself; `health` and `mode` are those of uavcan.protocol.NodeStatus.

    While it is `silent` it sends nothing at all; while it is `cut` off, what it sends reaches nobody. BusNode ID 0 is
    an anonymous node, which may only send messages.
    """

    def __init__(self, world: World, number: int, name: str, dice: Random, *, silent: bool = False) -> None:
        self.number, self.name, self.silent = number, name, silent
        self.cut = False
        self.health = self.mode = 0
        self.unique_id = dice.randbytes(16)
        self.transfer_ids: dict[tuple[str, int | None], int] = {}
        self._world = world
        self._since = world.now
        if number:
            world.every(STATUS_PERIOD, self._status, world.now + dice.randrange(STATUS_PERIOD))
            world.hear("uavcan.protocol.GetNodeInfo.Request", self._asked)

    def send(
        self,
        name: str,
        values: Values,
        *,
        dst: int | None = None,
        priority: int | None = None,
        transfer_id: int | None = None,
    ) -> Sending:
        """Send a transfer now; `transfer_id` overrides the counter, as a response must."""
        message = self._world.message(name)
        if transfer_id is None:
            transfer_id = next_id(self, message.table, dst)
        sending = Sending(
            self.number,
            message,
            values,
            dst,
            LOWEST if priority is None else priority,
            transfer_id,
            message.signature,
            anonymous=not self.number,
        )
        if not self.silent and not self.cut:
            self._world.send(sending)
        return sending

    def restart(self) -> None:
        """Cycle the power: transfer IDs and uptime start from zero."""
        self.transfer_ids.clear()
        self._since = self._world.now

    @property
    def status(self) -> dict[str, Any]:
        """The values of its NodeStatus."""
        return {
            "uptime_sec": (self._world.now - self._since) // SECOND,
            "health": self.health,
            "mode": self.mode,
            "sub_mode": 0,
            "vendor_specific_status_code": 0,
        }

    def _status(self) -> None:
        self.send("uavcan.protocol.NodeStatus", self.status)

    def _asked(self, request: Sending) -> None:
        if request.dst == self.number and not self.silent:
            self._world.at(self._world.now + _THINKING, lambda: self._introduce(request))

    @property
    def introduction(self) -> dict[str, Any]:
        """The values of its answer to GetNodeInfo."""
        return {
            "status": self.status,
            "software_version": {
                "major": 2,
                "minor": 2,
                "optional_field_flags": 0,
                "vcs_commit": 0,
                "image_crc": 0,
            },
            "hardware_version": {
                "major": 1,
                "minor": 0,
                "unique_id": self.unique_id,
                "certificate_of_authenticity": b"",
            },
            "name": self.name.encode(),
        }

    def _introduce(self, request: Sending) -> None:
        self.send(
            "uavcan.protocol.GetNodeInfo.Response",
            self.introduction,
            dst=request.node,
            priority=request.priority,
            transfer_id=request.transfer_id,
        )
