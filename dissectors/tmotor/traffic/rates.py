"""How often a vehicle talks, so that its bus carries it.

At 1 Mbit/s: RawCommand at 400 Hz (4.4.1 explanation 5), ESCStatus at 30 Hz and MotorStatus at 5 Hz for each ESC. Eight
ESCs then send fewer than the 2400 frames a second that the document allows while motors turn (4.4.6 explanation 3).

On a slower bus every rate falls in proportion to the bit rate: at 125 kbit/s RawCommand comes at 50 Hz and ESCStatus at
4 Hz. With more than eight ESCs a slow bus lowers the status rate further, in proportion to their number. A status rate
that somebody asks for is kept as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

from dissectors.traffic import MILLISECOND, SECOND

# Bit rates by their code (4.4.2 no 24).
BUS_RATES = (1_000_000, 500_000, 250_000, 125_000, 100_000, 50_000)
# The document's recommendation (4.4.1 explanation 3).
MANY = 8
_FULL = BUS_RATES[0]
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
    """The rates of a vehicle; `wanted` is the rate of ESCStatus in Hz that somebody asked for."""
    slow = max(1.0, _FULL / bit_rate)
    few = 1.0 if slow == 1.0 else min(1.0, MANY / escs)
    return Rates(
        command=round(2.5 * MILLISECOND * slow),
        status=max(1, round(30 * few / slow)) if wanted is None else wanted,
        push=round(SECOND // 5 * slow),
        gap=min(round(3 * MILLISECOND * slow), _ALL_ANSWER // escs),
        bus=BUS_RATES.index(bit_rate) if bit_rate in BUS_RATES else 0,
        slow=slow,
    )
