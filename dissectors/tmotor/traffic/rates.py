"""How often a vehicle talks, so that its bus carries it.

At 1 Mbit/s: RawCommand at 400 Hz (4.4.1 explanation 5), ESCStatus at 30 Hz and MotorStatus at 5 Hz for each ESC. Eight
ESCs then send fewer than the 2400 frames a second that the document allows while motors turn (4.4.6 explanation 3).

On a slower bus as much of that goes out as its share of the 2400 frames allows, with room for questions and answers
(below 500 kbit/s these take more for a moment): RawCommand keeps its 400 Hz while it fits and is then as slow as it has
to be, but never so slow that ESCs miss it; the status rates fall with it. A status rate that somebody asks for is kept
as it is.
"""

from __future__ import annotations

from dissectors.records import dataclass
from dissectors.times import MILLISECOND, SECOND

# Bit rates by their code (4.4.2 no 24).
BUS_RATES = (1_000_000, 500_000, 250_000, 125_000, 100_000, 50_000)
# The document's recommendation (4.4.1 explanation 3).
MANY = 8
_FULL = BUS_RATES[0]
# Frames a second at 1 Mbit/s (4.4.6 explanation 3), and the share of a slower bus that is planned for.
_LIMIT, _PLANNED = 2400, 0.75
# Times between two RawCommand in ms, the first one if it fits; the last is half of what an ESC waits for.
_PERIODS = (2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.5, 20.0, 25.0, 40.0, 50.0)
# What one ESC reports at 1 Mbit/s: 30 ESCStatus of 3 frames and 5 MotorStatus of 5.
_STATUS, _PUSH = 30, 5
_REPORTS = _STATUS * 3 + _PUSH * 5
# All ESCs have answered within this time.
_ALL_ANSWER = 700 * MILLISECOND


@dataclass(frozen=True, slots=True)
class Rates:
    """`command`, `push` and `gap` in ns: between two RawCommand, two MotorStatus of one ESC, two ESCs' answers.

    `status` is that of ESCStatus in Hz, 0 to 400; `bus` is the code of the bit rate; `slow` is how many times slower
    than 1 Mbit/s the bus is.
    """

    command: int
    status: int
    push: int
    gap: int
    bus: int
    slow: float


def rates(bit_rate: int, escs: int, wanted: int | None) -> Rates:
    """Return the rates of a vehicle; `wanted` is the rate of ESCStatus in Hz that somebody asked for."""
    slow = max(1.0, _FULL / bit_rate)
    room = _PLANNED * _LIMIT / slow
    period = _PERIODS[0]
    if slow > 1:
        period = next((one for one in _PERIODS if _frames(escs, one) <= room), _PERIODS[-1])
    share = _PERIODS[0] / period
    if _frames(escs, period) > room and slow > 1:
        share = max(1 / _STATUS, share * (room - _commands(escs, period)) / (escs * _REPORTS * share))
    return Rates(
        command=round(period * MILLISECOND),
        status=max(1, int(_STATUS * share)) if wanted is None else wanted,
        push=round(SECOND / (_PUSH * share)),
        gap=min(round(3 * MILLISECOND * slow), _ALL_ANSWER // escs),
        bus=BUS_RATES.index(bit_rate) if bit_rate in BUS_RATES else 0,
        slow=max(slow, 1 / share),
    )


def _commands(escs: int, period: float) -> float:
    """Count frames of RawCommand a second: 14 bits a channel, in several frames with a CRC."""
    size = -(-14 * escs // 8)
    return (1 if size <= 7 else -(-(size + 2) // 7)) * 1000 / period


def _frames(escs: int, period: float) -> float:
    """Count frames a second with this time between two RawCommand, everything else slowed down alike."""
    return _commands(escs, period) + escs * _REPORTS * _PERIODS[0] / period
