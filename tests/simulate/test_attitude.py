"""The attitude of the simulated airframe."""

from __future__ import annotations

import pytest

from dissectors.tmotor.traffic.physics.airframe import arms
from dissectors.tmotor.traffic.physics.attitude import Attitude
from dissectors.tmotor.traffic.physics.motor import Motor


@pytest.mark.sampled(4)
@pytest.mark.parametrize("count", [4, 6, 8, 12])
def test_the_loop_brings_any_airframe_back_to_level(count: int) -> None:
    """The law of the physics under the stories: what tilts is level again, and drives away with the wrong sign."""
    for gain, level in ((1.0, True), (-1.0, False)):
        motors = [Motor(20.0) for _ in range(count)]
        attitude = Attitude(motors, arms(count), gain=gain)
        attitude.angle = [0.3, -0.2, 0.1]
        for _ in range(400):
            share = attitude.correction()
            for motor, arm in zip(motors, attitude.arms, strict=True):
                motor.speed = 260.0 * (1 + sum(a * b for a, b in zip(share, arm, strict=True)))
            attitude.advance(0.01)
        assert (max(map(abs, attitude.angle)) < 0.02) == level
        assert attitude.tipped != level
