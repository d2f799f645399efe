"""The parameter that a stock ESC has: its report rate, by uavcan.protocol.param.GetSet."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.tmotor.traffic.esc import Esc
    from dissectors.traffic import BusNode, Sending, World

_NAME = b"ESC_STATUS_RATE"
_THINKING = MILLISECOND
_SERVICE = "uavcan.protocol.param.GetSet"


class StockParameters:
    """Both sides of the service: who asks, and the ESCs that answer."""

    def __init__(self, world: World, escs: Sequence[Esc]) -> None:
        self._world = world
        self._escs = {esc.node.number: esc for esc in escs}
        world.hear(f"{_SERVICE}.Request", self._asked)

    def ask(self, node: BusNode, dst: int) -> Sending:
        """Ask for the parameter."""
        return self._request(node, dst, {"empty": {}})

    def set(self, node: BusNode, dst: int) -> Sending:
        """Set it to what it is."""
        return self._request(node, dst, {"integer_value": self._escs[dst].parameters["esc_fdb_rate"]})

    def _request(self, node: BusNode, dst: int, value: dict[str, Any]) -> Sending:
        return node.send(f"{_SERVICE}.Request", {"index": 0, "value": value, "name": _NAME}, dst=dst)

    def _asked(self, request: Sending) -> None:
        esc = self._escs.get(request.dst or 0)
        if esc is not None and not esc.node.silent:
            self._world.at(self._world.now + _THINKING, lambda: self._answer(esc, request))

    def _answer(self, esc: Esc, request: Sending) -> None:
        wanted = request.values["value"].get("integer_value")
        if wanted is not None and 1 <= wanted <= 400:
            esc.apply({**esc.parameters, "esc_fdb_rate": wanted})
        values = {
            "value": {"integer_value": esc.parameters["esc_fdb_rate"]},
            "default_value": {"integer_value": 30},
            "max_value": {"integer_value": 400},
            "min_value": {"integer_value": 1},
            "name": _NAME,
        }
        esc.node.send(
            f"{_SERVICE}.Response",
            values,
            dst=request.node,
            priority=request.priority,
            transfer_id=request.transfer_id,
        )
