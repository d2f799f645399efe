"""Several interfaces as one stream: by time, bounded, with every loss counted and told once."""

from __future__ import annotations

import struct
import threading
from collections import deque
from typing import TYPE_CHECKING

import can
import pytest
from kit.command import LIMIT, START, wait_until

from analyzer._native import Rows
from analyzer.live import remarks
from analyzer.live.interfaces import hub as module
from analyzer.live.interfaces.filters import Filters
from analyzer.live.interfaces.hub import Hub, InterfaceCounts
from analyzer.live.interfaces.naming import resolve
from analyzer.live.interfaces.receiver import open_receiver
from analyzer.tables import EVENTS

if TYPE_CHECKING:
    from analyzer._native import FrameBatch

SECOND = 10**9
COMMENT, DROP = EVENTS.index("comment"), EVENTS.index("drop")


class Receiver:
    """Gives what it is given, from its own thread; `behind` is what it still has at the end."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.failed: str | None = None
        self.behind: list[FrameBatch] = []
        self.closed = self.stuck = self._on_its_way = False
        self._given: deque[FrameBatch] = deque()
        self._new = threading.Condition()
        self._said = [f"{name}: open"]

    def give(self, *pieces: FrameBatch) -> None:
        """Waits until they have been received, and it is asked for more."""
        with self._new:
            self._given.extend(pieces)
            self._new.notify_all()
        wait_until(lambda: not self._given and not self._on_its_way)

    def receive(self, seconds: float) -> FrameBatch | None:
        assert seconds == module.SLICE
        while self.stuck:
            threading.Event().wait(0.01)
        with self._new:
            self._on_its_way = False
            self._new.wait_for(lambda: self._given, seconds)
            self._on_its_way = bool(self._given)
            return self._given.popleft() if self._given else None

    def finish(self) -> list[FrameBatch]:
        return self.behind

    def wake(self) -> None:
        with self._new:
            self._new.notify_all()

    def notes(self) -> list[str]:
        said, self._said = self._said, []
        return said

    def close(self) -> None:
        assert threading.current_thread() is threading.main_thread()
        self.closed = True


def frames(name: str, *times: float) -> FrameBatch:
    rows = Rows()
    for t in times:
        rows.frame(START + round(t * SECOND), name, 5, 0, b"ab")
    return rows.take()


def rows(*pieces: FrameBatch | None) -> list[tuple[str, float, str | int]]:
    """Bus, time from the start, and `frame`, the text of a comment or the number of a drop; in the order of rows."""
    found: list[tuple[int, str, float, str | int]] = []
    for piece in pieces:
        assert piece is not None
        plain, events = piece.columns()
        for at, (t, bus, line) in enumerate(_cells(plain)):
            found.append((line, piece.buses[bus], t, "frame"))
            assert plain["id"][4 * at] == 5
        offsets = struct.unpack(f"={len(events['text_offset']) // 4}i", events["text_offset"])
        valid = events["bus_valid"]
        for at, (t, bus, line) in enumerate(_cells(events)):
            known = valid is None or valid[at >> 3] >> (at & 7) & 1
            (number,) = struct.unpack_from("=I", events["class"], 4 * at)
            what = number if events["kind"][at] == DROP else events["text"][offsets[at] : offsets[at + 1]].decode()
            found.append((line, piece.buses[bus] if known else "", t, what))
    lines = [line for line, *_ in sorted(found)]
    assert lines == list(range(lines[0], lines[0] + len(lines)))  # they are numbered through
    return [(bus, t, what) for _, bus, t, what in sorted(found)]


def _cells(columns: dict[str, bytes]) -> list[tuple[float, int, int]]:
    count = len(columns["bus"])
    times, lines = (struct.unpack(f"={count}{kind}", columns[name]) for kind, name in (("q", "t"), ("I", "line")))
    return [((t - START) / SECOND, bus, line) for t, bus, line in zip(times, columns["bus"], lines, strict=True)]


def all_of(hub: Hub) -> list[tuple[str, float, str | int]]:
    """What comes until nothing comes twice in a row."""
    pieces: list[FrameBatch | None] = []
    while len(pieces) < 2 or pieces[-2:] != [None, None]:
        pieces.append(hub.take(0))
    return rows(*filter(None, pieces))


def test_rows_of_several_interfaces_by_time() -> None:
    a, b = Receiver("a"), Receiver("b")
    with Hub([a, b]) as hub:
        b.give(frames("b", 1, 4), frames("b", 4, 6))
        a.give(frames("a", 2, 3, 4, 5))
        assert [(bus, t) for bus, t, _ in all_of(hub)] == [
            ("b", 1), ("a", 2), ("a", 3), ("a", 4), ("b", 4), ("b", 4), ("a", 5), ("b", 6),
        ]  # fmt: skip
        assert hub.counts == {"a": InterfaceCounts(4), "b": InterfaceCounts(4)}
    assert (a.closed, b.closed) == (True, True)


def test_what_comes_late_finds_its_place() -> None:
    """Within one call: another thread may have been slower."""
    a, b = Receiver("a"), Receiver("b")
    with Hub([a, b]) as hub:
        a.give(frames("a", 1, 2, 3))
        first = hub.take(0)
        assert first is None
        b.give(frames("b", 1.5))
        assert [t for _, t, _ in rows(hub.take(0))] == [1, 1.5, 2, 3]
        a.give(frames("a", 5))
        b.give(frames("b", 0.5))  # too late
        assert [t for _, t, _ in all_of(hub)] == [0.5, 5]


def test_a_clock_that_is_ahead_holds_nobody_up() -> None:
    a, b = Receiver("a"), Receiver("b")
    with Hub([a, b]) as hub:
        a.give(frames("a", 9_000))
        b.give(frames("b", 1))
        assert hub.take(0) is None
        assert len(rows(hub.take(0))) == 2
        b.give(frames("b", 2))
        assert rows(hub.take(0)) == [("b", 2, "frame")]


def test_one_interface_waits_for_nobody() -> None:
    a = Receiver("a")
    with Hub([a]) as hub:
        a.give(frames("a", 2, 1, 3))
        assert [t for _, t, _ in rows(hub.take(0))] == [2, 1, 3]  # as they were received


def test_the_index_of_an_interface_stays() -> None:
    a, b = Receiver("a"), Receiver("b")
    with Hub([a, b]) as hub:
        b.give(frames("b", 1))
        assert hub.take(0) is None
        piece = hub.take(0)
        assert piece is not None
        assert (piece.buses, piece.columns()[0]["bus"]) == (["a", "b"], b"\1")
        a.give(frames("a", 2))
        hub.take(0)
        piece = hub.take(0)
        assert piece is not None
        assert (piece.buses, piece.columns()[0]["bus"]) == (["a", "b"], b"\0")


def test_a_full_queue_loses_what_is_new_and_says_so() -> None:
    a, b = Receiver("a"), Receiver("b")
    with Hub([a, b], most=6) as hub:
        a.give(frames("a", 1, 2, 3, 4, 5))
        b.give(frames("b", 6, 7))  # one too many
        b.give(frames("b", 8))
        a.give(frames("a", 9), frames("a", 10, 11))
        assert hub.counts == {"a": InterfaceCounts(5, 0, 3), "b": InterfaceCounts(1, 0, 2)}
        first = all_of(hub)
        a.give(frames("a", 12))
        a.give(frames("a", 13))
        assert first + all_of(hub) == [
            *[("a", t, "frame") for t in (1, 2, 3, 4, 5)], ("b", 8, 2), ("b", 8, "frame"),
            ("a", 12, 3), ("a", 12, "frame"), ("a", 13, "frame"),
        ]  # fmt: skip
        assert hub.counts == {"a": InterfaceCounts(7, 0, 3), "b": InterfaceCounts(1, 0, 2)}


def test_losses_of_the_kernel_in_rows_that_are_lost() -> None:
    """They are told together, and counted apart."""
    a = Receiver("a")
    with Hub([a], most=4) as hub:
        a.give(frames("a", 1, 2), remarks.make_drop(START + 3 * SECOND, 7, "a"), frames("a", 3))
        a.give(remarks.make_drop(START + 4 * SECOND, 9, "a"), frames("a", 4, 5))
        assert hub.counts == {"a": InterfaceCounts(3, 16, 2)}
        assert all_of(hub)[-2:] == [("a", 3, 7), ("a", 3, "frame")]
        a.give(frames("a", 6))
        assert all_of(hub) == [("a", 6, 11), ("a", 6, "frame")]


def test_what_is_said_of_an_interface_is_never_lost() -> None:
    a = Receiver("a")
    with Hub([a], most=2) as hub:
        a.give(frames("a", 1, 2), frames("a", 3), remarks.make_comment(START + 4 * SECOND, "a: link down", "a"))
        assert all_of(hub)[-1] == ("a", 4, "a: link down")
        assert hub.counts == {"a": InterfaceCounts(2, 0, 1)}
    assert rows(hub.take(0))[0][2] == 1  # told at the end: nothing came any more


def test_marks_stand_between_what_came_before_and_after() -> None:
    """Also when a frame from before the mark is received behind it."""
    times = iter([START + 2 * SECOND, START + 9 * SECOND])
    a = Receiver("a")
    with Hub([a], clock=lambda: next(times)) as hub:
        a.give(frames("a", 1))
        hub.add_comment("mark 1")
        first = hub.take(0)
        a.give(frames("a", 1.5, 3))
        assert rows(*filter(None, [first, hub.take(0)])) == [
            ("a", 1, "frame"), ("a", 1.5, "frame"), ("", 2, "mark 1"), ("a", 3, "frame"),
        ]  # fmt: skip
        hub.add_comment("mark 2")
        assert all_of(hub) == [("", 9, "mark 2")]


def test_the_end_gives_the_rest() -> None:
    a, b = Receiver("a"), Receiver("b")
    a.behind = [frames("a", 5), frames("a", 6)]
    hub = Hub([a, b])
    with hub:
        b.give(frames("b", 1))
        assert not hub.ended
        hub.close()
        assert hub.ended
        assert [t for _, t, _ in rows(hub.take(LIMIT))] == [1, 5, 6]
        assert hub.take(LIMIT) is None
    assert hub.counts == {"a": InterfaceCounts(2), "b": InterfaceCounts(1)}
    assert not [thread for thread in threading.enumerate() if thread.name in ("a", "b")]


def test_it_ends_when_all_have_failed() -> None:
    a, b = Receiver("a"), Receiver("b")
    b.behind = [remarks.make_comment(START, "b: gone for good", "b")]
    with Hub([a, b]) as hub:
        b.failed = "gone"
        a.give(frames("a", 1))
        assert not hub.ended
        a.failed = "gone as well"
        wait_until(lambda: hub.ended)
        assert [what for *_, what in rows(hub.take(LIMIT))] == ["b: gone for good", "frame"]


def test_half_a_queue_is_taken_at_once() -> None:
    a = Receiver("a")
    with Hub([a], most=8) as hub:
        a.give(frames("a", 1, 2, 3, 4))
        assert len(rows(hub.take(10 * LIMIT))) == 4


@pytest.mark.slow
def test_a_driver_that_does_not_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PATIENCE", 5 * module.SLICE)
    a, b = Receiver("a"), Receiver("b")
    a.stuck = True
    with Hub([a, b]) as hub:
        b.give(frames("b", 1))
    assert (a.closed, b.closed, hub.ended) == (False, True, True)
    assert hub.notes() == ["a: its driver does not answer, it is left open", "a: open", "b: open"]
    assert hub.notes() == []
    assert len(rows(hub.take(LIMIT))) == 1
    a.stuck = False
    wait_until(lambda: not any(thread.name == "a" for thread in threading.enumerate()))
    assert hub.ended


def test_one_name_twice() -> None:
    with pytest.raises(ValueError, match="a is given twice"):
        Hub([Receiver("a"), Receiver("b"), Receiver("a")])
    with pytest.raises(ValueError, match="is given twice"):  # rows would not keep what is different
        Hub([Receiver("x" * 64 + "1"), Receiver("x" * 64 + "2")])


def test_closed_before_it_began() -> None:
    a = Receiver("a")
    hub = Hub([a])
    hub.close()
    assert a.closed
    assert hub.take(0) is None


def test_two_virtual_buses(capfd: pytest.CaptureFixture[str]) -> None:
    """With python-can itself; every frame that was sent is received, and nothing is printed."""
    names = ["hub-1", "hub-2"]
    receivers = [open_receiver(resolve(f"virtual:{name}", {}), Filters()) for name in names]
    senders = [can.Bus(name, interface="virtual") for name in names]
    pieces: list[FrameBatch] = []
    with Hub(receivers) as hub:
        for number in range(200):
            senders[number % 2].send(can.Message(arbitration_id=5, is_extended_id=False))
        wait_until(lambda: sum(count.received for count in hub.counts.values()) == 200)
    while (piece := hub.take(0)) is not None:
        pieces.append(piece)
    for sender in senders:
        sender.shutdown()
    found = rows(*pieces)
    assert len(found) == 200
    assert [t for _, t, _ in found] == sorted(t for _, t, _ in found)
    assert hub.counts == {f"virtual:{name}": InterfaceCounts(100) for name in names}
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("also", [False, True])
def test_a_receiver_that_breaks_is_told(also: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it has is taken, and the other interfaces go on."""
    a, b = Receiver("a"), Receiver("b")
    broken = threading.Event()

    def fail(_: float) -> None:
        assert broken.wait(LIMIT)
        raise RuntimeError("a bug of the driver")

    a.behind = [frames("a", 3)]
    monkeypatch.setattr(a, "receive", fail)
    if also:
        monkeypatch.setattr(a, "finish", lambda: 1 / 0)
    with Hub([a, b]) as hub:
        broken.set()
        wait_until(lambda: a.failed is not None)
        b.give(frames("b", 1))
        assert not hub.ended
        told = "a: RuntimeError: a bug of the driver; nothing more is received"
        wait_until(lambda: not also or a.failed != "RuntimeError: a bug of the driver")
        notes = hub.notes()
        assert told in notes
        assert (hub.counts["b"].received, hub.counts["a"].received) == (1, 0 if also else 1)
        assert ("a: ZeroDivisionError: division by zero; nothing more is received" in notes) == also
