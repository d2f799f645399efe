"""A vehicle without any ESC on its bus: autopilot, GPS receiver with compass, power module; the receiver browns out."""

from __future__ import annotations

from math import cos, sin
from typing import TYPE_CHECKING

from dissectors.times import MILLISECOND, SECOND
from dissectors.traffic import Scenario

if TYPE_CHECKING:
    from dissectors.traffic import BusNode, Story

GPS, POWER = 42, 50
_ARMED, _DISARMED = 255, 0
_FIX, _COMPASS, _BATTERY, _ARMING = (round(SECOND / hertz) for hertz in (10, 25, 10, 1))
# The receiver boots, and finds satellites again so much later.
_BOOT, _SEARCH = 400 * MILLISECOND, (8, 14)
_FULL, _SAGGED = 49.4, 42.9
_AMPERES = 40.0
_LOG_ERROR = 3


class _Vehicle:
    """The devices on the bus; `fix` and `compass` are whether the receiver sends them."""

    def __init__(self, story: Story) -> None:
        self.story, self.world, self.random = story, story.world, story.random
        vehicle, world = story.vehicle, story.world
        for esc in vehicle.escs:
            esc.node.silent = True
        vehicle.ground.silent, vehicle.commanding = True, False
        self.autopilot: BusNode = vehicle.autopilot
        self.gps = world.device(GPS, "org.example.gps_compass")
        self.power = world.device(POWER, "org.example.power_module")
        self.fix = self.compass = True
        self.volts = _FULL
        world.every(_FIX, self._fix, 100 * MILLISECOND)
        world.every(_COMPASS, self._field, 110 * MILLISECOND)
        world.every(_BATTERY, self._battery, 120 * MILLISECOND)
        world.every(_ARMING, self._arming, 130 * MILLISECOND)

    def _arming(self) -> None:
        armed = self.world.now > self.world.end // 5
        values = {"status": _ARMED if armed else _DISARMED}
        self.autopilot.send("uavcan.equipment.safety.ArmingStatus", values, priority=16)

    def _fix(self) -> None:
        if not self.fix:
            return
        t = self.world.now // 1000
        values = {
            "timestamp": {"usec": t},
            "gnss_timestamp": {"usec": t + 1_400_000_000_000_000},
            "gnss_time_standard": 2,
            "num_leap_seconds": 18,
            "longitude_deg_1e8": 1_016_000_000 + t // 100,
            "latitude_deg_1e8": 4_790_000_000,
            "height_ellipsoid_mm": 540_000,
            "height_msl_mm": 494_000,
            "ned_velocity": [3.0, 0.5, 0.0],
            "sats_used": 17,
            "status": 3,
            "mode": 0,
            "sub_mode": 0,
            "covariance": [],
            "pdop": 1.1,
            "ecef_position_velocity": [],
        }
        self.gps.send("uavcan.equipment.gnss.Fix2", values, priority=16)

    def _field(self) -> None:
        if not self.compass:
            return
        heading = self.world.now / SECOND / 10
        values = {
            "sensor_id": 0,
            "magnetic_field_ga": [0.21 * cos(heading), 0.21 * sin(heading), 0.43],
            "magnetic_field_covariance": [],
        }
        self.gps.send("uavcan.equipment.ahrs.MagneticFieldStrength2", values, priority=16)

    def _battery(self) -> None:
        values = {
            "temperature": 300.0,
            "voltage": self.volts + self.random.gauss(0, 0.03),
            "current": _AMPERES + self.random.gauss(0, 0.4),
            "average_power_10sec": 1900.0,
            "remaining_capacity_wh": 600.0,
            "full_charge_capacity_wh": 1000.0,
            "hours_to_full_charge": 0.0,
            "status_flags": 1,
            "state_of_health_pct": 100,
            "state_of_charge_pct": 60,
            "state_of_charge_pct_stdev": 2,
            "battery_id": 0,
            "model_instance_id": 0,
            "model_name": b"",
        }
        self.power.send("uavcan.equipment.power.BatteryInfo", values, priority=16)

    def brown_out(self) -> None:
        """Let the voltage dip, and the receiver with it."""
        story, world = self.story, self.world
        story.settle("device", ("device", "battery", "wiring"), nodes=(GPS,), within=200 * MILLISECOND)
        story.tell(f"the supply dips to {_SAGGED} V; node {GPS} restarts")
        self.volts = _SAGGED
        world.at(world.now + 200 * MILLISECOND, self._recovered)
        self.gps.restart()
        self.gps.silent = True
        self.fix = self.compass = False
        world.at(world.now + _BOOT, self._booted)

    def _recovered(self) -> None:
        self.volts = _FULL

    def _booted(self) -> None:
        self.gps.silent = False
        values = {"level": {"value": _LOG_ERROR}, "source": b"AP_Periph", "text": b"Reset: brownout"}
        self.gps.send("uavcan.protocol.debug.LogMessage", values)
        self.world.at(self.world.now + self.random.randint(*_SEARCH) * SECOND, self._found)

    def _found(self) -> None:
        self.story.tell(f"node {GPS} has a position again; its compass never comes back")
        self.fix = True


def _gps_restart(story: Story) -> None:
    vehicle = _Vehicle(story)
    story.world.at(round(story.world.end * story.random.uniform(0.45, 0.6)), vehicle.brown_out)


SCENARIO = Scenario(
    "gps-restart",
    "a GPS receiver restarts in flight, on a bus without any ESC",
    "Autopilot, GPS receiver with compass, and power module share a bus; the ESCs have none. In flight the supply dips "
    "and the receiver starts anew: its uptime is zero, its compass never comes back, its position after some seconds.",
    _gps_restart,
    seconds=60.0,
)
