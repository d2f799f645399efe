"""How a vehicle loads its bus: rates, limits of the document, arbitration, slow buses; and that a seed decides it."""

from __future__ import annotations

from bisect import bisect_left
from itertools import pairwise
from statistics import median

import pytest
from kit.simulated import FLIGHT_PLANS, end, flown, peak, simulation

from analyzer.simulate.bits import arbitration, duration
from analyzer.simulate.text import line
from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.rates import BUS_RATES, rates


@pytest.mark.sampled(4)
@pytest.mark.parametrize("seconds", [3, 10])
@pytest.mark.parametrize("plan", FLIGHT_PLANS)
def test_eight_escs_keep_the_limit_of_the_document(plan: str, seconds: float) -> None:
    """4.4.6 explanation 3: 2400 frames a second while motors turn; no second of the whole flight has more."""
    flight = flown(seconds, flight=plan, escs=8)
    assert peak([frame.t for frame in flight.frames]) <= 2400


@pytest.mark.sampled(2)
@pytest.mark.parametrize("rate", [None, 1, 10, 50, 200])
def test_reports_come_at_their_rate(rate: int | None) -> None:
    """4.4.2 no 25-26, and the ESC says so."""
    flight = flown(6, escs=2, rate=rate)
    for node in flight.escs:
        times = [one.t for one in flight.of("ESCStatus", node)]
        gaps = [after - before for before, after in pairwise(times)]
        assert median(gaps) == pytest.approx(SECOND / (rate or 30), rel=1e-3)
        assert max(gaps) < 1.01 * min(gaps)
        assert {one.values["esc_fdb_rate"] for one in flight.of("ParamGet", node)} == {rate or 30}
    assert flight.simulation.key()["settings"]["rate_hz"] == (rate or 30)


@pytest.mark.slow
def test_commands_come_at_400_hz_once_every_esc_has_reported() -> None:
    """4.4.1 explanation 5; TYP-103, BUS-026, BUS-027."""
    flight = flown(6, flight="startup", escs=3)
    commands = flight.of("RawCommand")
    assert {after.t - before.t for before, after in pairwise(commands)} == {2_500_000}
    assert {len(one.values["cmd"]) for one in commands} == {3}
    reported = {one.values["esc_index"] for one in flight.of("ESCStatus") if end(one) < end(commands[0])}
    assert reported == {0, 1, 2}


def test_motor_status_comes_at_5_hz() -> None:
    flight = flown(8, escs=4)
    for node in flight.escs:
        times = [one.t for one, _ in flight.packets("MotorStatus", node)]
        assert median(after - before for before, after in pairwise(times)) == pytest.approx(SECOND / 5, rel=0.02)


def test_escs_take_turns() -> None:
    """Their reports are spread over the period, not in one burst."""
    flight = flown(6, escs=8)
    times = sorted(one.t % (SECOND // 30) for one in flight.of("ESCStatus")[:8])
    gaps = [after - before for before, after in pairwise(times)]
    assert min(gaps) > 2 * MILLISECOND


@pytest.mark.parametrize(("plan", "escs", "bit_rate"), [("mission", 8, 1_000_000), ("bench", 4, 125_000)])
def test_arbitration(plan: str, escs: int, bit_rate: int) -> None:
    """No two frames overlap; of those that wait the lowest identifier goes first; nobody waits for an idle bus."""
    flight = flown(4, flight=plan, escs=escs, bit_rate=bit_rate)
    bit = SECOND // bit_rate
    # Recorded times are whole microseconds, cut off.
    spans = [(frame.t + 3 * bit - duration(frame, bit), frame) for frame in flight.frames]
    for (start, frame), (following, after) in pairwise(spans):
        assert following >= frame.t + 3 * bit - 1000
        waited = after.sending is not None and after.sending.t < start
        if waited:
            assert arbitration(after) >= arbitration(frame)
            assert following <= frame.t + 3 * bit + 1000
    for start, frame in spans:
        assert frame.sending is not None
        assert start >= frame.sending.t - 1000


@pytest.mark.sampled(2)
@pytest.mark.parametrize("escs", [1, 8, 20])
@pytest.mark.parametrize("bit_rate", BUS_RATES[1:])
def test_a_slow_bus_is_not_overloaded(bit_rate: int, escs: int) -> None:
    flight = flown(3, escs=escs, bit_rate=bit_rate)
    bit = SECOND // bit_rate
    assert sum(duration(frame, bit) for frame in flight.frames) / flight.frames[-1].t < 0.9
    late = [end(one) - one.t for one in flight.of("RawCommand") + flight.of("ESCStatus")]
    assert max(late) < 100 * MILLISECOND
    commands = flight.of("RawCommand")
    assert max(after.t - before.t for before, after in pairwise(commands)) <= 50 * MILLISECOND
    codes = {one.values["esc_can_rate"] for one in flight.of("ParamGet")}
    assert codes <= {BUS_RATES.index(bit_rate)}


def test_rates_scale_with_the_bus() -> None:
    def commands(escs: int) -> list[float]:
        return [rates(bit_rate, escs, None).command / MILLISECOND for bit_rate in BUS_RATES]

    assert commands(4) == [2.5, 2.5, 5, 10, 12.5, 25]
    assert commands(8) == [2.5, 6, 12.5, 25, 40, 50]
    assert commands(20)[1:][-1] == 50, "an ESC waits 100 ms"
    assert [rates(bit_rate, 4, None).status for bit_rate in BUS_RATES] == [30, 30, 15, 7, 6, 3]
    assert rates(50_000, 8, 100).status == 100
    assert rates(125_000, 20, None).status < rates(125_000, 8, None).status


@pytest.mark.slow
@pytest.mark.parametrize("bit_rate", BUS_RATES[:2])
def test_a_bus_has_its_share_of_the_documents_limit(bit_rate: int) -> None:
    """BUS-003: 2400 frames a second at 1 Mbit/s, and as much less as the bus is slower."""
    for escs in (1, 4, 8):
        times = [frame.t for frame in flown(8, escs=escs, bit_rate=bit_rate).frames]
        busiest = max(at - bisect_left(times, t - SECOND) + 1 for at, t in enumerate(times))
        assert busiest <= 2400 * bit_rate / 1_000_000, escs


def text(seed: int, **settings: object) -> str:
    return "".join(line(frame, 0, ("can0", "can1")) for frame in simulation(3, seed=seed, **settings).frames())


@pytest.mark.sampled(2)
@pytest.mark.parametrize("plan", FLIGHT_PLANS)
def test_a_seed_decides_every_byte(plan: str) -> None:
    first = text(1, flight=plan, escs=3)
    assert first == text(1, flight=plan, escs=3)
    assert first != text(2, flight=plan, escs=3)


@pytest.mark.slow
def test_transfer_ids_follow_each_other() -> None:
    """4.1.3, for each type, sender and receiver, from zero; a response has its request's; anonymous ones are free."""
    for plan in FLIGHT_PLANS:
        flight = flown(8, flight=plan, escs=4)
        last: dict[tuple[str, int, int | None], int] = {}
        for one in flight.sent:
            if one.anonymous or one.message.kind == "response":
                continue
            key = (one.name, one.node, one.dst)
            assert one.transfer_id == (last.get(key, -1) + 1) % 32, (plan, key)
            last[key] = one.transfer_id
        assert len(last) > 20


@pytest.mark.slow
def test_everything_of_the_document_has_the_lowest_priority() -> None:
    """4.3.1; only the throttle of stock ESCs is as autopilots send it."""
    for stock in (False, True):
        flight = flown(5, escs=3, stock=stock)
        for one in flight.sent:
            assert one.priority == (7 if stock and one.name == "RawCommand" else 31)
