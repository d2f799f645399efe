"""The flights: what the pilot wants, second by second, scaled to the time there is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.records import dataclass, replace

if TYPE_CHECKING:
    from random import Random

# Motors turn slowly while the vehicle is armed on the ground (throttle 0 to 1).
IDLE_THROTTLE = 0.06


@dataclass(frozen=True, slots=True)
class Leg:
    """From `start` (s) on: motors off, armed on the ground (idle), or flying to `height` (m) at `climb` m/s.

    A height below zero is a landing. `roll`, `pitch` and `yaw` are shares of the throttle that the manoeuvre takes.
    """

    start: float
    state: str = "off"
    height: float = 0.0
    climb: float = 1.5
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0


def ground_time(duration: float) -> float:
    """Return seconds before the motors start: 2, less in a short simulation."""
    return min(2.0, 0.2 * duration)


def take_off(duration: float, height: float) -> list[Leg]:
    """Return the legs off, armed, then up."""
    ground = ground_time(duration)
    return [Leg(0.0), Leg(ground, "idle"), Leg(ground + min(1.0, 0.07 * duration), "fly", height)]


def landing(duration: float, height: float) -> list[Leg]:
    """Return the legs down and off, if there is time: the last fifth of 20 s or more, not sooner than it takes."""
    if duration < 20:
        return []
    down = height / 0.8 + 1.5
    return [Leg(duration - down - 2.2, "fly", -0.5, 0.8), Leg(duration - 2.2, "idle"), Leg(duration - 1.4)]


def hover(duration: float) -> list[Leg]:
    """Return the legs up, stay, and land."""
    height = 2.0
    return [*take_off(duration, height), *landing(duration, height)]


def cruise(duration: float) -> list[Leg]:
    """Return the legs up to a height from which a fall takes time."""
    *ground, up = take_off(duration, 15.0)
    return [*ground, Leg(up.start, up.state, up.height, climb=5.0)]


def later(legs: list[Leg], seconds: float) -> list[Leg]:
    """Return the same legs, so much later."""
    return [replace(leg, start=leg.start + seconds) for leg in legs]


def mission(duration: float, random: Random) -> list[Leg]:
    """Return the legs of a mission: up, turns between changes of height, and land."""
    legs = take_off(duration, 4.0)
    down = landing(duration, 6.0)
    end = down[0].start if down else duration
    now, height = legs[-1].start + min(3.0, 0.15 * duration), 4.0
    longest = min(12.0, max(1.0, duration / 8))
    while now < end - longest / 2:
        height = random.uniform(3.0, 6.0)
        side = random.uniform(-0.03, 0.03)
        legs.append(Leg(now, "fly", height, roll=side, pitch=-random.uniform(0.03, 0.07)))
        now += random.uniform(0.6, 1.0) * longest
        turn = random.choice((-1, 1))
        legs.append(Leg(now, "fly", height, roll=0.04 * turn, pitch=-0.02, yaw=0.05 * turn))
        now += random.uniform(0.2, 0.35) * longest
    return [*(leg for leg in legs if leg.start < end), *down]
