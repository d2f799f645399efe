"""Events: what each kind tells, when, and what nearly is one."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
from kit.encode import log_line
from kit.flight import Vehicle
from kit.traffic import ALIVE, MS, TURNING, WELL, alive, log
from kit.traffic import commanded as command
from kit.traffic import in_order as text
from kit.traffic import milliseconds as ms
from kit.traffic import of_kinds as kinds
from kit.traffic import turning as status

if TYPE_CHECKING:
    from collections.abc import Callable

    Told = Callable[..., tuple[list[dict[str, Any]], list[dict[str, Any]]]]

ARMING, LOG = "uavcan.equipment.safety.ArmingStatus", "uavcan.protocol.debug.LogMessage"
OVER_TEMPERATURE = 1 << 5


def when(one: dict[str, Any]) -> tuple[int | None, ...]:
    return tuple(ms(one[name]) for name in ("t", "t_end", "until"))


# ---- faults, modes


def test_a_fault_from_its_onset_to_its_end(told: Told) -> None:
    hot = {"error_count": 4 << 12 | OVER_TEMPERATURE}
    rows = [status(t) for t in range(0, 200, 40)]
    rows += [status(t, temperature=100.0 + t / 100, current=5.0, **hot) for t in range(200, 400, 40)]
    rows += [status(t) for t in range(400, 600, 40)]
    (one,) = kinds(told(text(rows))[1], "fault")
    assert (when(one), one["bus"], one["node"], one["ch"], one["text"]) == (
        (160, 200, 400), 0, 11, 1, "MOS over temperature",
    )  # fmt: skip
    values = json.loads(one["values"])
    assert (values["temperature"], values["worst_temperature"]) == (102.0, pytest.approx(103.6, abs=0.1))
    assert (values["voltage"], values["current"], values["speed"]) == (48.5, 5.0, 3011.0)
    assert one["clause"].startswith("4.4.3")
    assert one["frame"] == 5 * 3


def test_numbers_that_json_does_not_know(told: Told) -> None:
    hot = {"error_count": 4 << 12 | OVER_TEMPERATURE, "voltage": float("inf"), "current": float("nan")}
    (one,) = kinds(told(text(status(t, temperature=90.0, **hot) for t in range(0, 400, 40)))[1], "fault")
    assert set(json.loads(one["values"])) == {"temperature", "worst_temperature", "speed", "worst_speed"}


def test_a_fault_that_was_always_there_and_stays(told: Told) -> None:
    (one,) = kinds(told(text(status(t, error_count=4 << 12 | 1) for t in range(0, 400, 40)))[1], "fault")
    assert (when(one), one["text"]) == ((None, 0, None), "over voltage")


def test_a_stock_error_count_is_no_fault(told: Told) -> None:
    """Kelvin and a count that grows: the dialect of the standard, in which no bit is a fault."""
    rows = [status(t, error_count=t // 40, temperature=310.0) for t in range(0, 1000, 40)]
    assert kinds(told(text(rows))[1], "fault", "mode") == []


def test_a_mode_that_changes(told: Told) -> None:
    rows = [status(t, error_count=(4 if t < 400 else 6) << 12) for t in range(0, 800, 40)]
    (one,) = kinds(told(text(rows))[1], "mode")
    assert (when(one), one["text"]) == ((360, 400, None), "operating -> error")


def test_health_that_changes_and_health_from_the_start(told: Told) -> None:
    rows = [(t, 42, ALIVE, WELL | {"uptime_sec": t // 1000, "health": int(t >= 2000)}) for t in range(0, 4000, 500)]
    (one,) = kinds(told(text(rows))[1], "health")
    assert (when(one), one["node"], one["text"]) == ((1500, 2000, None), 42, "ok -> warning")
    rows = [(t, 42, ALIVE, WELL | {"uptime_sec": 9, "health": 2}) for t in range(0, 2000, 500)]
    (one,) = kinds(told(text(rows))[1], "health")
    assert (when(one), one["text"]) == ((None, 0, None), "error")


# ---- silence


def steady(stop: int, *, hole: tuple[int, int] = (0, 0), ids: bool = True, period: int = 20) -> bytes:
    """An ESC beside a node that always speaks; transfer IDs count in the hole if it did send there."""
    sent, number = [], 0
    for t in range(0, stop, period):
        inside = hole[0] <= t < hole[1]
        if not inside:
            sent.append((t, "ESCStatus", 11, number))
        number += ids or not inside
    net = Vehicle()
    for t, name, node, k in sent:
        net.send(t, name, node, TURNING, transfer_id=k % 32)
    for t in range(3, stop, 10):
        net.command(t, 4000)
    return "".join(f"{log_line(row.frame)}\n" for row in net.rows() if row.frame).encode()


@pytest.mark.parametrize(("ids", "said"), [(True, "transfer IDs jump by 6"), (False, "no transfer ID missing")])
def test_who_falls_silent_and_comes_back(ids: bool, said: str, told: Told) -> None:
    (one,) = kinds(told(steady(2000, hole=(1000, 1100), ids=ids))[1], "silence")
    assert one["text"] == f"ESCStatus stops, back after 120 ms, {said}"
    values = json.loads(one["values"])
    assert (values["silent_s"], values["period_s"]) == (pytest.approx(0.12, abs=1e-3), pytest.approx(0.02, abs=1e-3))
    assert one["until"] - one["t"] == pytest.approx(120 * MS, abs=MS)
    assert one["t_end"] - one["t"] == pytest.approx(20 * MS, abs=MS)


def test_three_missing_in_a_row_are_no_silence(told: Told) -> None:
    assert kinds(told(steady(2000, hole=(1000, 1060)))[1], "silence") == []


def test_a_torn_transfer_is_no_silence(told: Told) -> None:
    """It is told only when the next one with its ID comes, 32 periods later."""
    said = steady(4000).splitlines(keepends=True)
    torn = next(
        k for k, line in enumerate(said)
        if k > len(said) // 2 and line.split()[2][6:8] == b"0B" and 0x40 <= int(line.split()[2][-2:], 16) < 0x80
    )  # fmt: skip
    events = told(b"".join(said[:torn] + said[torn + 1 :]))[1]
    assert kinds(events, "silence", "rate") == []


def test_who_is_silent_to_the_end(told: Told) -> None:
    (one,) = kinds(told(steady(2000, hole=(1000, 2000)))[1], "silence")
    assert (one["until"], one["text"]) == (None, "ESCStatus stops, to the end")


def test_commands_that_stop(told: Told) -> None:
    rows = [command(t, 3000) for t in range(0, 1000, 10)] + [status(t) for t in range(0, 2000, 40)]
    (one,) = kinds(told(text(rows))[1], "commands stop")
    assert (when(one)[:1], one["node"], one["text"]) == ((990,), 1, "nothing is commanded, to the end")


def test_who_goes_slower_is_not_silent(told: Told) -> None:
    rows = [status(t) for t in (*range(0, 1000, 20), *range(1000, 9000, 200))]
    rows += [command(t + 3, 100) for t in range(0, 9000, 10)]
    events = told(text(rows))[1]
    assert kinds(events, "silence") == []
    (one,) = kinds(events, "rate")
    assert one["text"] == "ESCStatus comes slower: every 200 ms, 20 ms before"


def test_who_sends_now_and_then_is_never_silent(told: Told) -> None:
    times, t = [], 0
    for k in range(120):
        t += (10, 500, 35)[k % 3]
        times.append(t)
    rows = [status(t) for t in times] + [command(t, 100) for t in range(3, t, 10)]
    assert kinds(told(text(rows))[1], "silence", "rate") == []


# ---- nodes


def test_a_node_that_starts_anew(told: Told) -> None:
    rows = [(t * 1000.0, alive(up, 42, k)) for k, (t, up) in enumerate(zip(range(6), (117, 118, 119, 0, 1, 2)))]  # noqa: B905
    (one,) = kinds(told(log(*rows).encode())[1], "restart")
    assert (when(one), one["node"], one["text"]) == ((2000, 3000, None), 42, "starts anew: uptime 119 s -> 0 s")


def test_an_old_report_again_is_no_restart(told: Told) -> None:
    rows = [(t * 1000.0, alive(up, 42, k)) for k, (t, up) in enumerate(zip(range(6), (117, 118, 119, 118, 121, 122)))]  # noqa: B905
    assert kinds(told(log(*rows).encode())[1], "restart") == []


def test_who_joins(told: Told) -> None:
    rows = [(t, 10, ALIVE, WELL | {"uptime_sec": 5}) for t in range(0, 4000, 500)]
    rows += [(t, 42, ALIVE, WELL | {"uptime_sec": 0}) for t in range(2100, 4000, 500)]
    rows += [(t, 43, ALIVE, WELL | {"uptime_sec": 0}) for t in range(900, 4000, 500)]
    assert [(one["node"], when(one)) for one in kinds(told(text(rows))[1], "join")] == [(42, (None, 2100, None))]


def test_what_a_node_says_and_who_arms(told: Told) -> None:
    words = {"level": {"value": 3}, "source": list(b"AP"), "text": list("Reset: \x1b[2J brownout µ".encode())}
    rows = [(100, 42, LOG, words), *((t, 10, ARMING, {"status": 255 * (t > 1500)}) for t in range(0, 3000, 500))]
    events = told(text(rows))[1]
    (one,) = kinds(events, "message")
    assert (one["node"], one["text"]) == (42, "error AP: Reset: \x1b[2J brownout µ")
    (one,) = kinds(events, "arming")
    assert (when(one), one["text"]) == ((1500, 2000, None), "is armed")


# ---- commands, voltage


def test_commands_that_are_zero_after_they_were_more(told: Told) -> None:
    rows = [command(t, *((0, 0) if t < 100 or 500 <= t < 700 else (3000, 0))) for t in range(0, 900, 10)]
    (one,) = kinds(told(text(rows))[1], "commands zero")
    assert when(one) == (490, 500, 700)


@pytest.mark.parametrize(("cmd", "stop", "found"), [(8191, 600, [2]), (8191, 570, []), (8100, 600, [])])
def test_saturation(cmd: int, stop: int, found: list[int], told: Told) -> None:
    rows = [command(t, 6000, cmd if 480 <= t < stop else 6000) for t in range(0, 900, 10)]
    assert [one["ch"] for one in kinds(told(text(rows))[1], "saturation")] == found


@pytest.mark.parametrize(("low", "found"), [(2500, 1), (3600, 0)])
def test_spread(low: int, found: int, told: Told) -> None:
    rows = [command(t, 6800, low if 480 <= t < 600 else 6000) for t in range(0, 900, 10)]
    assert len(kinds(told(text(rows))[1], "spread")) == found


@pytest.mark.parametrize(("pause", "found"), [(400, 1), (700, 2)])
def test_a_spread_that_swings_is_one(pause: int, found: int, told: Told) -> None:
    wide = {t for start in (500, 600 + pause) for t in range(start, start + 100, 10)}
    rows = [command(t, 6800, 2000 if t in wide else 6000) for t in range(0, 2000, 10)]
    spreads = kinds(told(text(rows))[1], "spread")
    assert [when(one)[1] for one in spreads] == [500, 600 + pause][:found]
    assert when(spreads[-1])[2] == 700 + pause


@pytest.mark.parametrize(("volts", "found"), [(42.0, 1), (43.5, 0)])
def test_a_voltage_that_falls(volts: float, found: int, told: Told) -> None:
    rows = [
        status(t, **({"voltage": 48.5} if t < 1000 else {"voltage": volts, "current": 40.0}))
        for t in range(0, 3000, 40)
    ]
    sags = kinds(told(text(rows))[1], "sag")
    assert len(sags) == found
    for one in sags:
        assert when(one) == (960, 1000, 2000)  # 1 s later it is as it was
        assert one["text"] == "voltage falls from 48.5 to 42.0 V, current goes from 1.2 to 40.0 A"


@pytest.mark.parametrize(("fall", "load", "found"), [(0.3, 20.0, 0), (1.0, 20.0, 1), (1.0, 1.2, 0)])
def test_a_voltage_that_sinks(fall: float, load: float, found: int, told: Told) -> None:
    """Within seconds; near misses are a pack in use, and one of which nobody knows what its current costs."""
    rows = [
        status(t, voltage=50 - fall * max(0, t - 4000) / 1000, current=1.2 if t % 2000 < 1000 else load)
        for t in range(0, 10_000, 40)
    ]
    sags = kinds(told(text(rows))[1], "sag")
    assert len(sags) == found
    for one in sags:
        assert when(one) == (5880, 8400, None)  # 3 % and 8 % below what the current explains
        assert one["text"].startswith("voltage sinks from 50.0 to 44.0 V, current goes from ")
