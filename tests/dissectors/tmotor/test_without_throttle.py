"""ESCs whose throttle is missing: what each does, PWM that takes over, and motors that turn on."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import pytest
from kit.flight import SECOND, START, Vehicle
from kit.judged import whole

if TYPE_CHECKING:
    from kit.judged import Said

COAST_DOWN, FOLD = 5, 7
SOME = 2949  # 36 %
WIDTH = 13_640  # of 36 %, in 0.1 us


class Flight(Vehicle):
    """A vehicle that is asked several questions."""

    @cached_property
    def text(self) -> str:
        return self.finish()


def lost(after: float, cmd: tuple[int, ...] = (SOME,), **reports: Any) -> Flight:
    """Throttle for a second, and then none; the ESC reports all the time, `after` ms longer."""
    vehicle = Flight()
    vehicle.commands(0, 1000, *cmd)
    vehicle.statuses(5, 1000, rpm=3000, power_rating_pct=36, current=9.0)
    vehicle.statuses(1005, 1000 + after, **{"rpm": 3000, "power_rating_pct": 36, "current": 9.0} | reports)
    return vehicle


def told(vehicle: Flight, rule: str) -> list[tuple[str, str]]:
    """Severity and text, in one batch and in several."""
    return [(one.severity, one.text) for one in whole(vehicle.text, (rule,), (41,))]


def found(vehicle: Flight, rule: str) -> list[Said]:
    """The same, in batches of one size."""
    return whole(vehicle.text, (rule,), (150,))


def test_an_esc_that_holds_and_goes_to_zero() -> None:
    vehicle = lost(120)
    vehicle.statuses(1120, 2000, rpm=1500)
    vehicle.statuses(2000, 4000)
    assert told(vehicle, "BUS-017") == [
        ("note", "ch1: held 36 % for 130 ms, then went to zero; stood still after 1.0 s")
    ]  # fmt: skip
    assert found(vehicle, "BUS-038") == []


def test_an_esc_that_does_not_hold() -> None:
    vehicle = lost(0)
    vehicle.statuses(1005, 2000, rpm=900)
    ((_, text),) = told(vehicle, "BUS-017")
    assert (
        text == "ch1: held 36 % for 15 ms, then went to zero; still 900 rpm after 995 ms, to the end of the recording"
    )


@pytest.mark.slow
def test_an_esc_that_tells_no_throttle_is_judged_by_its_speed() -> None:
    vehicle = Flight()
    vehicle.commands(0, 1000, SOME)
    vehicle.statuses(5, 1400, rpm=3000)
    vehicle.statuses(1405, 1600, rpm=2600)
    vehicle.statuses(1605, 3000)
    assert told(vehicle, "BUS-017") == [
        ("note", "ch1: kept 3000 rpm for 415 ms, then slowed down; stood still after 615 ms")
    ]  # fmt: skip


def test_throttle_that_comes_back_while_it_is_held() -> None:
    vehicle = lost(800)
    vehicle.commands(1800, 2800, SOME)
    vehicle.statuses(1805, 2800, rpm=3000, power_rating_pct=36)
    assert told(vehicle, "BUS-017") == [("note", "ch1: held 36 % for 795 ms, until throttle came back")]
    assert found(vehicle, "BUS-038") == []
    soon = lost(80)
    soon.commands(1080, 2000, SOME)
    assert found(soon, "BUS-017") == []


@pytest.mark.sampled(4)
@pytest.mark.parametrize("negative", [False, True])
def test_a_motor_that_turns_on_is_an_error(negative: bool) -> None:
    vehicle = lost(5000)
    if negative:
        vehicle.commands(1000, 6000, -600)
    why = "-600 since" if negative else "no command since"
    ((severity, text),) = told(vehicle, "BUS-038")
    assert (severity, text) == (
        "error", f"ch1: {why} 36 %, 2.0 s later 3000 rpm at 36 %, on for 3.0 s to the end, 3000 rpm at most"
    )  # fmt: skip
    ((_, held),) = told(vehicle, "BUS-017")
    assert held == "ch1: held 36 % for 5.0 s, to the end of the recording"


def test_a_channel_that_is_left_out_is_that_of_its_esc_alone() -> None:
    vehicle = lost(5000, cmd=(SOME, SOME))
    vehicle.commands(1000, 6000, SOME)
    vehicle.statuses(5, 6000, 12, rpm=2900, power_rating_pct=36, current=9.0)
    ((severity, text),) = told(vehicle, "BUS-038")
    assert (severity, text.partition(",")[0]) == ("error", "ch2: no channel since 36 %")


def test_a_motor_that_only_its_packets_tell_of() -> None:
    vehicle = Flight()
    vehicle.commands(0, 1000, SOME)
    for k in range(60):
        vehicle.push(k * 100, "PUSHCAN.MotorStatus", 11, 0xA1, speed=-3000, throttle=90, pwm=WIDTH)
    ((severity, text),) = told(vehicle, "BUS-038")
    assert severity == "error"
    assert text.startswith("ch1: no command since 36 %, 2.0 s later -3000 rpm at 36 %, on for ")


@pytest.mark.slow
def test_a_motor_that_turns_backwards_under_negative_throttle() -> None:
    vehicle = Flight()
    vehicle.commands(0, 1000, 0)
    vehicle.commands(1000, 6000, -3000)
    vehicle.statuses(5, 1000)
    vehicle.statuses(1005, 6000, rpm=-2000, power_rating_pct=30, current=5.0)
    ((severity, text),) = told(vehicle, "BUS-038")
    assert (severity, text.partition(",")[0]) == ("error", "ch1: -3000 since 0 %")
    assert found(vehicle, "BUS-017") == []


@pytest.mark.sampled(6)
@pytest.mark.parametrize(
    "reports",
    [
        {"power_rating_pct": 0, "current": 0.0},  # the wind turns it as fast as before
        {"power_rating_pct": 0, "rpm": 1400},  # it runs down
        {"power_rating_pct": 0, "mode": COAST_DOWN},
        {"mode": FOLD},
        {"rpm": 400},
    ],
)
def test_a_motor_that_is_not_driven_may_turn(reports: dict[str, Any]) -> None:
    assert found(lost(5000, **reports), "BUS-038") == []


@pytest.mark.slow
def test_a_motor_that_keeps_speed_and_current_is_driven_whatever_it_says() -> None:
    ((severity, text),) = told(lost(5000, power_rating_pct=0), "BUS-038")
    assert (severity, "3000 rpm at 0 %" in text) == ("error", True)


def test_a_landing_says_nothing() -> None:
    vehicle = Flight()
    vehicle.commands(0, 1000, SOME)
    vehicle.commands(1000, 2000, 0)
    vehicle.statuses(5, 1000, rpm=3000, power_rating_pct=36)
    vehicle.statuses(1005, 1500, rpm=900)
    vehicle.statuses(1505, 8000)
    assert found(vehicle, "BUS-017") == []
    assert found(vehicle, "BUS-038") == []


@pytest.mark.slow
def test_a_recording_that_ends_soon_after_says_no_more_than_it_shows() -> None:
    vehicle = lost(1500)
    assert found(vehicle, "BUS-038") == []
    assert told(vehicle, "BUS-017") == [("note", "ch1: held 36 % for 1.5 s, to the end of the recording")]


def test_a_gap_of_the_recording_is_no_loss_of_throttle() -> None:
    vehicle = lost(0)
    vehicle.status(6000, rpm=3000, power_rating_pct=36, current=9.0)
    vehicle.commands(6005, 7000, SOME)
    vehicle.statuses(6020, 7000, rpm=3000, power_rating_pct=36, current=9.0)
    assert found(vehicle, "BUS-038") == []
    assert found(vehicle, "BUS-017") == []


def test_another_controller_that_takes_over() -> None:
    vehicle = lost(5000)
    vehicle.commands(1050, 6000, SOME, src=2)
    assert found(vehicle, "BUS-038") == []
    assert found(vehicle, "BUS-017") == []


@pytest.mark.sampled(3)
@pytest.mark.parametrize(("unit", "count"), [(0xA1, 0), (0xFF, 0), (0xA2, 1)])
def test_a_control_packet_that_drives_it(unit: int, count: int) -> None:
    vehicle = lost(5000)
    vehicle.push(1050, "PUSHSCI.OutputControl", 126, unit, control_mode=0x33, set_point=3000)
    assert len(found(vehicle, "BUS-038")) == count


@pytest.mark.sampled(3)
@pytest.mark.parametrize(("priority", "count"), [(0, 0), (1, 1)])
def test_a_node_in_which_pwm_has_priority(priority: int, count: int) -> None:
    vehicle = lost(5000)
    vehicle.parameters(500, esc_signal_priority=priority)
    assert len(found(vehicle, "BUS-038")) == count


@pytest.mark.slow
def test_an_esc_that_the_other_bus_commands() -> None:
    first, second = lost(5000), lost(5000)
    second.commands(1000, 6000, SOME)
    lines = sorted((first.text + second.text.replace(" can0 ", " can1 ")).splitlines(keepends=True))
    assert whole("".join(lines), ("BUS-038",), (150,)) == []


def test_a_loss_is_as_long_as_the_clock_of_its_bus_says() -> None:
    each = list[tuple[str, str]]()
    for line in lost(2500).text.splitlines(keepends=True):
        stamp, _, frame = line.split(" ", 2)
        t = float(stamp[1:-1])
        back = t > START / SECOND + 3.3
        each.append((f"({t - back:.6f}) can0 {frame}", f"({t:.6f}) can1 {frame}"))
    alone = "".join(one for one, _ in each)
    assert whole(alone, ("BUS-038",), (150,)) == []
    both = whole("".join(one + other for one, other in each), ("BUS-038",), (150,))
    assert [(one.bus, one.severity) for one in both] == [(1, "error")]


@pytest.mark.sampled(6)
@pytest.mark.parametrize(
    ("before", "after", "severities", "course"),
    [
        (0, 15_000, [], "PWM took over (1500.0 us, 3000 rpm)"),  # there was none before
        (12_000, 13_700, [], "PWM took over (1370.0 us, 3000 rpm)"),
        (WIDTH, 14_000, ["warning"], "followed PWM, or commands that are not recorded (1400.0 us, 3000 rpm)"),
        (WIDTH, WIDTH, ["error"], ""),  # it is the throttle that the ESC holds
        (0, 0, ["error"], ""),
        (15_000, 15_000, ["error"], ""),  # 51 %, and the ESC applies 36 %
    ],
)
def test_pwm_that_takes_over(before: int, after: int, severities: list[str], course: str) -> None:
    vehicle = lost(5000)
    for k in range(60):
        width = before if k < 11 else after
        vehicle.push(k * 100 + 2, "PUSHCAN.MotorStatus", 11, 0xA1, speed=3000, throttle=90, pwm=width)
    assert [severity for severity, _ in told(vehicle, "BUS-038")] == severities
    assert len(told(vehicle, "BUS-034")) == bool(course)
    ((_, text),) = told(vehicle, "BUS-017")
    assert text == f"ch1: held 36 %, then {course}" if course else text.startswith("ch1: held 36 % for 5.0 s")


def test_an_esc_that_reports_throttle_loss_is_not_driven_by_pwm() -> None:
    vehicle = lost(5000, bits=8)
    for k in range(60):
        width = WIDTH if k < 11 else 14_000
        vehicle.push(k * 100 + 2, "PUSHCAN.MotorStatus", 11, 0xA1, speed=3000, throttle=90, pwm=width)
    assert [severity for severity, _ in told(vehicle, "BUS-038")] == ["error"]


@pytest.mark.slow
@pytest.mark.parametrize("step", [1, 7])
def test_it_is_the_same_however_the_capture_is_cut(step: int) -> None:
    vehicle = lost(120, cmd=(SOME, SOME))
    vehicle.statuses(1120, 3000, rpm=600)
    vehicle.statuses(5, 4000, 12, rpm=2900, power_rating_pct=36, current=9.0)
    for k in range(40):
        width = WIDTH if k < 11 else 14_000
        vehicle.push(k * 100 + 2, "PUSHCAN.MotorStatus", 12, 0xA2, speed=2900, throttle=90, pwm=width)
    vehicle.commands(4000, 4500, SOME, SOME)
    assert len(whole(vehicle.text, ("BUS-017", "BUS-034", "BUS-038"), (step,))) == 4


def test_each_esc_is_told() -> None:
    vehicle = lost(120, cmd=(SOME, SOME))
    vehicle.statuses(1120, 3000)
    vehicle.statuses(5, 6000, 12, rpm=2900, power_rating_pct=36, current=9.0)
    assert [(one.node, one.text.partition(" for")[0]) for one in found(vehicle, "BUS-017")] == [
        (11, "ch1: held 36 %"), (12, "ch2: held 36 %"),
    ]  # fmt: skip
    assert [(one.node, one.severity) for one in found(vehicle, "BUS-038")] == [(12, "error")]
