"""The ground station: it asks for parameters, sets them, and sends every command of PUSHSCI (4.4.2, 4.4.4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.tmotor.traffic.packets import EVERY_UNIT, packet
from dissectors.tmotor.traffic.parameters import KEEP, QUERY, TEMPORARY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.tmotor.traffic.esc import Esc
    from dissectors.tmotor.traffic.packets import Raw
    from dissectors.traffic import BusNode, Sending, World


class Ground:
    """The ground station and all that it can send. It knows an ESC's UUID once it has seen its ParamGet."""

    def __init__(self, world: World, node: BusNode, escs: Sequence[Esc]) -> None:
        self.node = node
        self.known: dict[int, int] = {}
        self.data_sequence = 0
        self._escs = escs
        self._counts: dict[int, int] = {}
        world.hear("ParamGet", self._reported)

    def query(self) -> Sending:
        """Ask every ESC for its parameters: 27 bytes 0xFF (4.4.2 explanation 2)."""
        return self.node.send("ParamCfg", dict(QUERY))

    def configure(self, index: int, **changes: Any) -> Sending:
        """Set parameters of one ESC by the names of ParamCfg, for now; without any only ask for them.

        The ESC is addressed by its UUID and index, or by its index alone while the UUID is not known.
        """
        address = {"esc_index": index, "esc_uuid": self.known.get(index, QUERY["esc_uuid"])}
        return self.node.send("ParamCfg", {**QUERY, "esc_save_option": TEMPORARY, **address, **changes})

    def push(self, name: str, unit: int, *, sum_end: int | None = None, **values: Raw) -> Sending:
        """Send a packet to a unit (0xA1 to 0xA9, or 0xFF for all); what FocParameters leaves out is not changed."""
        count = self._counts.get(unit, 0)
        self._counts[unit] = (count + 1) % 256
        if name == "FocParameters":
            values = {**KEEP, **values}
            sum_end = sum_end or next((esc.sum_end for esc in self._escs if esc.unit == unit), None)
        data = packet(name, count, unit, values, sum_end=sum_end)
        sending = self.node.send("PUSHSCI", {"data_sequence": self.data_sequence, "data": data})
        self.data_sequence = (self.data_sequence + 1) % 2**32
        return sending

    def shift_frame_count(self, unit: int, by: int) -> None:
        """Shift the frame count of the next packet to a unit by so many."""
        self._counts[unit] = (self._counts.get(unit, 0) + by) % 256

    def ask_all(self) -> Sending:
        """Ask every unit for its FOC parameters (4.4.4 table 3)."""
        return self.push("FocQuery", EVERY_UNIT)

    def _reported(self, sending: Sending) -> None:
        self.known.setdefault(sending.values["esc_index"], sending.values["esc_uuid"])
