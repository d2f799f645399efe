"""Dynamic allocation of node IDs: devices without one ask by anonymous frames, in three parts of their unique ID.

The rules and times are those of uavcan.protocol.dynamic_node_id.Allocation. A request carries up to 6 bytes of the
unique ID, so its 16 bytes go in parts of 6, 6 and 4; the allocator repeats all it has heard so far after each of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import MILLISECOND

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.simulate.device import Device
    from dissectors.traffic import Sending, World

ALLOCATION = "uavcan.protocol.dynamic_node_id.Allocation"
PART, WHOLE = 6, 16
# Trequest and Tfollowup, both random. The second may be up to 400 ms; devices that power up together keep it short.
REQUEST = (600 * MILLISECOND, 1000 * MILLISECOND)
FOLLOW_UP = (2 * MILLISECOND, 60 * MILLISECOND)
# The allocator forgets a request that is not followed up in this time.
TIMEOUT = 500 * MILLISECOND
_THINKING = MILLISECOND
_HIGHEST = 125


class Allocator:
    """The server: the one device that grants IDs, each the preferred one or the next free one above it."""

    def __init__(self, world: World, device: Device, used_ids: Callable[[], set[int]]) -> None:
        """Take the bus, the server's device, and what tells the IDs in use now."""
        self.granted: dict[bytes, int] = {device.unique_id: device.number}
        self._world, self._device, self._used_ids = world, device, used_ids
        self._so_far = b""
        self._heard_at = 0
        world.hear(ALLOCATION, self._heard)

    def _heard(self, sending: Sending) -> None:
        values = sending.values
        if not sending.anonymous or self._device.silent:
            return
        now, part = self._world.now, bytes(values["unique_id"])
        if now - self._heard_at > TIMEOUT:
            self._so_far = b""
        if values["first_part_of_unique_id"]:
            self._so_far = part
        elif self._so_far and len(part) == min(PART, WHOLE - len(self._so_far)):
            self._so_far += part
        else:
            return
        self._heard_at = now
        known = self._so_far
        number = self._grant(known, values["node_id"]) if len(known) == WHOLE else 0
        self._world.at(now + _THINKING, lambda: self._answer(known, number))
        if number:
            self._so_far = b""

    def _answer(self, known: bytes, number: int) -> None:
        self._device.send(ALLOCATION, {"node_id": number, "first_part_of_unique_id": False, "unique_id": known})

    def _grant(self, unique_id: bytes, wanted: int) -> int:
        """Return the ID of a device; 0 if none is free."""
        if unique_id not in self.granted:
            start = wanted or _HIGHEST
            taken = self._used_ids().union(self.granted.values())
            order = (*range(start, _HIGHEST + 1), *range(start - 1, 0, -1))
            self.granted[unique_id] = next((number for number in order if number not in taken), 0)
        return self.granted[unique_id]


class Allocatee:
    """A device that has no ID yet: it wants its `number`, and is silent until it has it."""

    def __init__(self, world: World, device: Device, done: Callable[[], object]) -> None:
        self._world, self._device, self._done = world, device, done
        self._voice = world.device(0, device.name)
        self._turn = 0
        self._over = False
        self._sent: Sending | None = None
        world.hear(ALLOCATION, self._heard)
        self._wait(REQUEST, lambda: self._ask(0))

    def _wait(self, between: tuple[int, int], call: Callable[[], object]) -> None:
        """Call after a random time, unless something else is waited for by then."""
        self._turn += 1
        turn = self._turn
        then = self._world.now + self._world.random.randrange(*between)
        self._world.at(then, lambda: self._turn == turn and not self._over and call())

    def _ask(self, known: int) -> None:
        """Send the part of the unique ID behind the `known` bytes; begin again if nothing comes of it."""
        values = {
            "node_id": self._device.number,
            "first_part_of_unique_id": not known,
            "unique_id": self._device.unique_id[known : known + PART],
        }
        self._sent = self._voice.send(ALLOCATION, values)
        self._wait(REQUEST, lambda: self._ask(0))

    def _heard(self, sending: Sending) -> None:
        if self._over or sending is self._sent:
            return
        known = bytes(sending.values["unique_id"])
        mine = not sending.anonymous and self._device.unique_id.startswith(known)
        if mine and len(known) < WHOLE:
            self._wait(FOLLOW_UP, lambda: self._ask(len(known)))
        elif mine and sending.values["node_id"] == self._device.number:
            self._over = True
            self._device.silent = False
            self._device.transfer_ids.clear()
            self._done()
        else:
            self._wait(REQUEST, lambda: self._ask(0))
