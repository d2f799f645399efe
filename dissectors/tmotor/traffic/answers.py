"""How an ESC answers what the ground station sends: ParamCfg by ParamGet, packets in PUSHSCI by packets in PUSHCAN."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.packets import EVERY_UNIT, sound, split
from dissectors.tmotor.traffic.parameters import ANY_UUID, configure, configure_foc, feedback

if TYPE_CHECKING:
    from dissectors.tmotor.traffic.esc import Esc
    from dissectors.tmotor.traffic.packets import Raw
    from dissectors.tmotor.traffic.rates import Rates
    from dissectors.traffic import Sending

_THINKING = 2 * MILLISECOND
_VERSIONS: dict[str, Raw] = {"hardware_version": b"ALPHA60A-HV V1.2", "software_version": b"V2.2.0-20250314"}


class Answers:
    """The half of an ESC that listens. Packets for other units, and damaged ones, it passes over.

    When all are asked at once, each ESC answers a little later than the one before it.
    """

    def __init__(self, esc: Esc, rates: Rates) -> None:
        self._esc, self._world = esc, esc.world
        self._turn = _THINKING + esc.index * rates.gap
        esc.world.hear("ParamCfg", self._configured)
        esc.world.hear("PUSHSCI", self._pushed)

    def _configured(self, sending: Sending) -> None:
        esc, values = self._esc, sending.values
        uuid, index = values["esc_uuid"], values["esc_index"]
        mine = uuid == esc.uuid or (uuid == ANY_UUID and index in {esc.index, 0xFF})
        if not mine or esc.node.silent:
            return
        parameters = dict(esc.parameters)
        configure(parameters, values)
        esc.apply(parameters)
        self._later(self._report, alone=uuid == esc.uuid)

    def _report(self) -> None:
        esc = self._esc
        on = esc.parameters["esc_startup_duration"] + self._world.now // SECOND
        esc.node.send("ParamGet", {**esc.parameters, "esc_startup_duration": on})

    def _pushed(self, sending: Sending) -> None:
        esc = self._esc
        data = bytes(sending.values["data"])
        if esc.node.silent or esc.unit is None:
            return
        try:
            name, values = split(data)
        except ValueError:
            return
        unit = values["unit_id"]
        mine = unit == esc.unit or (unit == EVERY_UNIT and name == "FocQuery")
        if mine and sound(data):
            self._obey(name, values)

    def _obey(self, name: str, values: dict[str, Any]) -> None:
        esc = self._esc
        if name == "SetZero":
            esc.set_zero()
        elif name == "OutputControl":
            esc.command(values["control_mode"], values["set_point"])
            esc.reports.motor_status()
        elif name == "FocParameters":
            parameters = dict(esc.parameters)
            esc.position_loop = configure_foc(parameters, esc.position_loop, values)
            esc.apply(parameters)
            self._later(self._feed_back, alone=True)
        elif name == "FocQuery":
            self._later(self._feed_back, alone=values["unit_id"] != EVERY_UNIT)

    def _feed_back(self) -> None:
        esc = self._esc
        esc.reports.push("FocFeedback", {**_VERSIONS, **feedback(esc.parameters, esc.position_loop)})

    def _later(self, answer: Any, *, alone: bool) -> None:
        self._world.at(self._world.now + (_THINKING if alone else self._turn), answer)
