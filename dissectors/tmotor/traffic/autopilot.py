"""The autopilot on the bus: RawCommand at its rate, and a question to every node that appears."""

from __future__ import annotations

from math import exp
from random import Random
from typing import TYPE_CHECKING

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.throttle import FULL

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.tmotor.traffic.rates import Rates
    from dissectors.traffic import BusNode, Sending, World

# Its output stage follows the control loop this slowly (s), and shakes with the frame by this share.
_SMOOTH, _SHAKE = 0.012, 0.004
# Nodes are asked one after the other.
_BETWEEN = 200 * MILLISECOND
# What autopilots send stock ESCs their throttle with.
STOCK_PRIORITY = 7


class Autopilot:
    """`wanted` are the throttles (0 to 1) of the control loop, `last` the commands that went out.

    While `commanding` is off it sends no RawCommand. `hook` changes the commands before they are sent.
    """

    def __init__(self, world: World, node: BusNode, motors: int, rates: Rates, *, stock: bool) -> None:
        self.node = node
        self.commanding = True
        self.hook: Callable[[list[int]], list[int]] | None = None
        self.wanted = [0.0] * motors
        self.last = [0] * motors
        self._world, self._random = world, world.random
        # Dice of its own for what it does only when somebody joins: nothing else changes by that.
        self._patience = Random(world.random.random())
        self._now = [0.0] * motors
        self._period = rates.command
        self._share = 1 - exp(-rates.command / SECOND / _SMOOTH)
        self._priority = STOCK_PRIORITY if stock else None
        self._seen = {node.number}
        self._next = 0
        world.hear("uavcan.protocol.NodeStatus", self._noticed)

    def start(self) -> None:
        """Send RawCommand from now on."""
        self._world.every(self._period, self._command, self._world.now)

    def _command(self) -> None:
        share = self._share
        self._now = [
            now + (want - now) * share if want else 0.0 for now, want in zip(self._now, self.wanted, strict=True)
        ]
        if not self.commanding:
            return
        commands = _commands(self._now, self._random)
        if self.hook is not None:
            commands = self.hook(commands)
        self.last = commands
        self.node.send("RawCommand", {"cmd": list(commands)}, priority=self._priority)

    def _noticed(self, sending: Sending) -> None:
        if sending.node in self._seen:
            return
        self._seen.add(sending.node)
        self._next = max(self._next + _BETWEEN, self._world.now + self._patience.randrange(5, 60) * MILLISECOND)
        self._world.at(self._next, lambda: self.node.send("uavcan.protocol.GetNodeInfo.Request", {}, dst=sending.node))


def _commands(throttles: list[float], random: Random) -> list[int]:
    """Return the throttles as 4.4.1 has them, 0 to 8191, with the shaking of the airframe once it flies."""
    dice = random.random
    return [
        min(FULL, int(FULL * (value + _SHAKE * value * (dice() - 0.5)) + 0.5))
        if value > 0.08
        else int(FULL * value + 0.5)
        for value in throttles
    ]
