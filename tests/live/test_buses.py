"""From any other interface of python-can to rows: drivers that fail, babble, or have no clock."""

from __future__ import annotations

import errno
from collections import deque
from typing import Any

import can
import pytest
from kit.command import START
from kit.waiting import SECOND, Clock, everything, text

from analyzer.live.interfaces import drivers as buses
from analyzer.live.interfaces import journal as watching
from analyzer.live.interfaces.filters import Filters, parse_filters
from analyzer.live.interfaces.naming import Interface, InterfaceError, resolve
from analyzer.live.interfaces.receiver import open_receiver


class Driver:
    """A bus of a script: messages, errors, or nothing."""

    def __init__(self, *script: can.Message | Exception | None) -> None:
        self.script, self.closed = deque(script), False

    def recv(self, timeout: float) -> can.Message | None:
        assert timeout >= 0
        got = self.script.popleft() if self.script else None
        if isinstance(got, Exception):
            raise got
        return got

    def shutdown(self) -> None:
        self.closed = True


def message(seconds: float = 1.0, number: int = 5, **more: Any) -> can.Message:
    given = {"timestamp": START / SECOND + seconds, "is_extended_id": False} | more
    return can.Message(arbitration_id=number, **given)


@pytest.fixture
def drivers(monkeypatch: pytest.MonkeyPatch) -> deque[Driver | InterfaceError]:
    made: deque[Driver | InterfaceError] = deque()

    def open_one(_: Interface) -> Driver:
        one = made.popleft()
        if isinstance(one, InterfaceError):
            raise one
        return one

    monkeypatch.setattr(buses, "open_bus", open_one)
    return made


@pytest.fixture
def clock() -> Clock:
    return Clock()


def bus(clock: Clock, kind: str = "slcan", filters: Filters | None = None) -> buses.DriverReceiver:
    return buses.DriverReceiver(Interface(kind, "x"), filters or Filters(), clock.ns, clock.now, clock.sleep)


def test_messages_become_rows(drivers: deque[Any], clock: Clock) -> None:
    drivers.append(Driver(
        message(1.000001, data=b"abc"), message(2, is_rx=False), message(3, 0x12345, is_extended_id=True, data=b"x"),
        message(4, is_fd=True, data=bytes(12), dlc=12, bitrate_switch=True), message(5, is_remote_frame=True, dlc=3),
        message(6, 0x900),
    ))  # fmt: skip
    receiver = bus(clock)
    piece = receiver.receive(0.1)
    assert text(piece) == [
        "(01.000001) slcan:x 005#616263 R", "(02.000000) slcan:x 005# T", "(03.000000) slcan:x 00012345#78 R",
        "(04.000000) slcan:x 005##1000000000000000000000000 R", "(05.000000) slcan:x 005#R3 R",
    ]  # fmt: skip
    assert piece is not None
    assert (piece.lines["unreadable"], piece.stamps) == (1, 1 | 32)
    assert receiver.receive(0.1) is None
    assert receiver.notes() == []


@pytest.mark.parametrize(
    ("kind", "number", "line"),
    [
        ("virtual", 0x44, "20000044#0008 R"),
        ("virtual", 0, "20000080#0008 R"),
        ("pcan", 0x44, "20000080#0008 R"),
    ],
)
def test_error_frames(drivers: deque[Any], clock: Clock, kind: str, number: int, line: str) -> None:
    """What the identifier of one says depends on the driver."""
    error = message(1, number, is_error_frame=True, data=b"\0\x08")
    drivers.append(Driver(error))
    assert text(bus(clock, kind).receive(0.1)) == [f"(01.000000) {kind}:x {line}"]
    drivers.append(Driver(error))
    assert bus(clock, kind, parse_filters(["#1"])).receive(0.1) is None


def test_filters_hold_messages_off(drivers: deque[Any], clock: Clock) -> None:
    drivers.append(Driver(message(number=1), message(number=2), message(number=3)))
    assert [line.split()[2] for line in text(bus(clock, filters=parse_filters(["2~7FF"])).receive(0.1))] == [
        "001#",
        "003#",
    ]


@pytest.mark.parametrize(
    ("stamp", "told"),
    [
        (0.0, "no time stamps"),
        (12.5, "time stamps that do not count from 1970"),
        (float("nan"), "no time stamps"),
        (1e300, "no time stamps"),
    ],
)
def test_time_stamps_that_are_none(drivers: deque[Any], clock: Clock, stamp: float, told: str) -> None:
    drivers.append(Driver(message(timestamp=stamp), message(timestamp=stamp)))
    receiver = bus(clock)
    clock.seconds = 7.0000014
    said = f"slcan:x: its driver gives {told}: times are those of the moment when a frame was read"
    assert everything(receiver, clock) == [f"# {said}", *["(07.000001) slcan:x 005# R"] * 2]
    assert receiver.notes() == [said]


def test_a_driver_that_fails_once(drivers: deque[Any], clock: Clock) -> None:
    drivers.append(Driver(message(1), can.CanOperationError("no luck", 5), message(2)))
    receiver = bus(clock)
    assert everything(receiver, clock) == [
        "(01.000000) slcan:x 005# R", "# slcan:x: no luck; trying again", "# slcan:x: works again after 0.1 s",
        "(02.000000) slcan:x 005# R",
    ]  # fmt: skip
    assert receiver.notes() == ["slcan:x: no luck; trying again", "slcan:x: works again after 0.1 s"]


def test_an_adapter_that_is_pulled_out_and_put_back(drivers: deque[Any], clock: Clock) -> None:
    pulled = Driver(*[OSError(errno.EIO, "Input/output error")] * 100)
    drivers.extend([pulled, *[InterfaceError("slcan:x", "no such device")] * 5, Driver(message(9))])
    receiver = bus(clock)
    found = everything(receiver, clock, 30)
    assert found[0] == "# slcan:x: [Errno 5] Input/output error; trying again"
    assert found[1].startswith("# slcan:x: works again after ")
    assert found[2:] == ["(09.000000) slcan:x 005# R"]
    assert pulled.closed
    assert receiver.failed is None


def test_an_adapter_that_does_not_come_back(drivers: deque[Any], clock: Clock) -> None:
    drivers.append(Driver(*[can.CanOperationError("gone")] * 2))
    drivers.extend([InterfaceError("slcan:x", "no such device")] * 1000)
    receiver = bus(clock)
    found: list[str] = []
    while receiver.failed is None:
        found += everything(receiver, clock)
    assert receiver.failed.startswith("no such device; given up after 1.")
    assert watching.LIMIT <= clock.seconds < watching.LIMIT + 2 * watching.LONGEST
    assert found == ["# slcan:x: gone; trying again", f"# slcan:x: {receiver.failed}"]
    assert len(drivers) > 950  # the pauses grew
    assert receiver.receive(0.1) is None


def test_a_driver_that_works_only_now_and_then(drivers: deque[Any], clock: Clock) -> None:
    """What is said of it does not flood."""
    script = [step for _ in range(10_000) for step in (message(1), can.CanOperationError("again"))]
    drivers.append(Driver(*script))
    receiver = bus(clock)
    said = sum(line.startswith("#") for line in everything(receiver, clock, 300))
    assert receiver.failed is None
    assert said < 2 * (300 / watching.LONGEST + 10)


def test_an_adapter_that_has_worked_is_waited_for_without_end(drivers: deque[Any], clock: Clock) -> None:
    drivers.append(Driver(message(1), *[can.CanOperationError("gone")] * 2))
    receiver = bus(clock)
    drivers.extend([InterfaceError("slcan:x", "no such device")] * 200)
    drivers.append(Driver(message(9)))
    found: list[str] = []
    while len(found) < 4:
        piece = receiver.receive(watching.LONGEST)
        found += [] if piece is None else text(piece)
        assert receiver.failed is None
    assert clock.seconds > 10 * watching.LIMIT
    assert found[1] == "# slcan:x: gone; trying again"
    assert found[2].startswith("# slcan:x: works again after ")
    assert found[3:] == ["(09.000000) slcan:x 005# R"]


def test_failures_that_take_their_time_are_a_series(
    drivers: deque[Any], clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Be it longer than what is calm."""
    drivers.append(Driver(*[can.CanOperationError("gone")] * 2))
    receiver = bus(clock)

    def open_slowly(_: Interface) -> Driver:
        clock.seconds += 5 * watching.CALM
        raise InterfaceError("slcan:x", "no such device")

    monkeypatch.setattr(buses, "open_bus", open_slowly)
    while receiver.failed is None:
        receiver.receive(0.1)
        assert clock.seconds < 10 * watching.LIMIT
    assert receiver.failed.startswith("no such device; given up after ")


def test_failures_far_apart_are_no_series(drivers: deque[Any], clock: Clock) -> None:
    drivers.append(Driver())
    receiver = bus(clock)
    for _ in range(100):
        receiver._bus.script.append(can.CanOperationError("now and then"))  # type: ignore[union-attr]
        everything(receiver, clock, 2 * watching.CALM)
    assert clock.seconds > 10 * watching.LIMIT
    assert receiver.failed is None


def test_a_driver_that_cannot_even_be_closed(
    drivers: deque[Any], clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver = Driver()
    drivers.append(driver)
    monkeypatch.setattr(driver, "shutdown", lambda: 1 / 0)
    receiver = bus(clock)
    receiver.wake()
    receiver.close()
    assert receiver.finish() == []


def test_the_virtual_bus() -> None:
    """With python-can itself: own frames are not seen twice, those of others are received ones."""
    receiver = open_receiver(resolve("virtual:receiver", {}), Filters())
    with can.Bus("receiver", interface="virtual") as other:
        other.send(can.Message(arbitration_id=0x123, data=b"ab"))
        (line,) = text(receiver.receive(0.5))
    assert line.split(" ", 1)[1] == "virtual:receiver 00000123#6162 R"
    receiver.close()


def test_a_bus_that_cannot_be_opened() -> None:
    with pytest.raises(InterfaceError, match=r"^can_none: (this system has no SocketCAN|no such interface)"):
        open_receiver(resolve("can_none", {}), Filters())
