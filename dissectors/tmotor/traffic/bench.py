"""The bench: motors in turn through steps of throttle, then every control mode of OutputControl (4.4.4 table 4)."""

from __future__ import annotations

from dissectors.records import dataclass
from dissectors.tmotor.traffic import control
from dissectors.tmotor.traffic.flights import IDLE_THROTTLE, ground_time

_STEPS = (0.15, 0.3, 0.45, 0.6, 0.3)
# Control modes and raw set points, slow enough for a propeller that somebody stands beside: below 500 rpm.
TRIALS = (
    (control.FORWARD_FOLD, 0),
    (control.FREE, 0),
    (control.SPEED, 300),
    (control.BRAKE, 200),
    (control.REVERSE_FOLD, 0),
    (control.LOCK, 0),
    (control.DUTY, 400),
    (control.REVERSE_DUTY, 350),
    (control.CURRENT, 50),
    (control.REVERSE_CURRENT, 40),
    (control.REVERSE_SPEED, 250),
    (control.POSITION, 900),
    (control.REVERSE_POSITION, 1800),
)


@dataclass(frozen=True, slots=True)
class Bench:
    """Throttles on the bench: while one motor is tried, the others turn slowly; `duration` in s."""

    motors: int
    duration: float

    @property
    def stop(self) -> float:
        """Seconds until the throttles are zero for good."""
        return 0.55 * self.duration

    @property
    def control(self) -> float:
        """Seconds until the control modes begin: the last motor has run out."""
        return self.stop + min(2.5, 0.12 * self.duration)

    def throttles(self, seconds: float, _step: float, _thrust: float) -> list[float]:
        """Return throttles from 0 to 1 for the time `seconds`."""
        start = ground_time(self.duration)
        throttles = [0.0] * self.motors
        if start <= seconds < self.stop:
            at = int((seconds - start) / (self.stop - start) * self.motors * len(_STEPS))
            throttles = [IDLE_THROTTLE] * self.motors
            throttles[at // len(_STEPS)] = _STEPS[at % len(_STEPS)]
        return throttles
