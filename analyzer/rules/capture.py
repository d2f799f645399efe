"""What the recorder itself says, and what its record lacks: times, gaps, unreadable lines, drops, error frames."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.overflow import overflowed
from analyzer.rules.drops import drops_in, when
from analyzer.tables import EVENTS, FRAME_ANOMALIES, distinct
from dissectors.conformance import MILLISECOND, NO_TIME, SECOND, Found, Occurrence, Watcher, watches

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.conformance import View, Words

_BACKWARDS = 1 << FRAME_ANOMALIES.index("time backwards")
_ERROR_FRAME, _UNREADABLE = EVENTS.index("error frame"), EVENTS.index("unreadable")
NO_BUS = -1
# Frames before a gap whose order may be mixed up.
_MIXED = 64
# Error classes (linux/can/error.h), and the bits of the data bytes that say more.
_CLASSES = {
    0x001: "transmit timeout",
    0x002: "lost arbitration",
    0x010: "transceiver error",
    0x020: "no acknowledge",
    0x040: "bus-off",
    0x100: "restarted",
}
_CONTROLLER, _PROTOCOL, _BUS_ERROR = 0x004, 0x008, 0x080
_OF_CONTROLLER = {
    0x02: "transmit overflow",
    0x04: "receive warning",
    0x08: "transmit warning",
    0x10: "receive passive",
    0x20: "transmit passive",
    0x40: "error active again",
}
_OF_PROTOCOL = {
    0x01: "bit error",
    0x02: "form error",
    0x04: "stuffing error",
    0x08: "bit error (dominant)",
    0x10: "bit error (recessive)",
    0x20: "overload",
}
_CRC_PLACES = (0x08, 0x18)  # CRC sequence and delimiter, in byte 3
_ACK_PLACES = (0x19, 0x1B)


@lru_cache(maxsize=1024)
def kind_of(error_class: int, data: bytes) -> str:
    """An error frame in words."""
    more = data.ljust(4, b"\0")
    said = [text for bit, text in _CLASSES.items() if error_class & bit]
    if error_class & _CONTROLLER:
        said += _named(_OF_CONTROLLER, more[1]) or ["controller error"]
    if error_class & _PROTOCOL:
        place = "CRC error" if more[3] in _CRC_PLACES else "no acknowledge" if more[3] in _ACK_PLACES else ""
        said += _named(_OF_PROTOCOL, more[2]) or [place or "protocol violation"]
        if place and place not in said:
            said.append(place)
    if not said:
        said = ["bus error" if error_class & _BUS_ERROR else f"class 0x{error_class:03X}"]
    return " and ".join(dict.fromkeys(said))


def _named(names: dict[int, str], bits: int) -> list[str]:
    return [text for bit, text in names.items() if bits & bit]


class Backwards(Watcher):
    """CAP-001: a time stamp before the last one of the same interface."""

    rules = ("CAP-001",)

    def __init__(self) -> None:
        self._last: dict[int, int] = {}

    def look(self, view: View) -> Iterator[Found]:
        """The native core marks the frames; by how much is looked up for those."""
        frames = view.frames
        if not len(frames):
            return
        if int(np.bitwise_or.reduce(frames.anomaly)) & _BACKWARDS:
            rows = np.flatnonzero(frames.anomaly & _BACKWARDS)
            back = self._steps(view, rows)
            yield view.among_frames(
                "CAP-001",
                rows,
                lambda row: {"milliseconds": back[row] / MILLISECOND, "frame": frames.first + row + 1},
            )
        for bus in distinct(frames.bus):
            at = len(frames) - 1 - int(np.argmax(frames.bus[::-1] == bus))
            if frames.t[at] == NO_TIME:
                mine = np.flatnonzero((frames.bus == bus) & (frames.t != NO_TIME))
                at = int(mine[-1]) if len(mine) else -1
            if at >= 0:
                self._last[bus] = int(frames.t[at])

    def _steps(self, view: View, rows: Words) -> dict[int, int]:
        """How far back each row is."""
        t, bus = view.frames.t, view.frames.bus
        back: dict[int, int] = {}
        for one in np.unique(bus[rows]).tolist():
            mine = np.flatnonzero((bus == one) & (t != NO_TIME))
            times = np.concatenate(([self._last.get(one, NO_TIME)], t[mine]))
            here = np.searchsorted(mine, rows[bus[rows] == one])
            back |= dict(zip(mine[here].tolist(), (times[here] - times[here + 1]).tolist(), strict=True))
        return back


class Gaps(Watcher):
    """CAP-002: a time without a frame of any interface."""

    rules = ("CAP-002",)

    def __init__(self) -> None:
        self._last: tuple[Words, list[tuple[int, int]]] = (np.empty(0, np.int64), [])

    def look(self, view: View) -> Iterator[Occurrence]:
        """Compares each time with that of the frame before, also across batches."""
        frames = view.frames
        rows = None if (frames.t != NO_TIME).all() else np.flatnonzero(frames.t != NO_TIME)
        old = len(self._last[0])
        t = np.concatenate((self._last[0], frames.t if rows is None else frames.t[rows]))
        silence = view.number("CAP-002", "silence_s") * SECOND
        late = (np.flatnonzero(np.diff(t) > silence) + 1).tolist()

        def place(at: int) -> tuple[int, int]:
            """Number and interface of a frame."""
            if at < old:
                return self._last[1][at]
            row = at - old if rows is None else int(rows[at - old])
            return row + frames.first, int(frames.bus[row])

        for at in late:
            if at < old:
                continue
            # A frame that came late hides an even later one before it.
            before = np.arange(max(0, at - _MIXED), at)
            before = before[t[before] <= t[at - 1] + silence]
            last = int(before[np.argmax(t[before])])
            gap = int(t[at] - t[last])
            if gap > silence:
                number, bus = place(last)
                yield Occurrence("CAP-002", int(t[last]), bus, None, "", (number,), {"seconds": gap / SECOND})
        self._last = t[-_MIXED:].copy(), [place(at) for at in range(max(0, len(t) - _MIXED), len(t))]


@watches("CAP-003")
def unreadable(view: View) -> Iterator[Found]:
    """Lines that are not what the format allows."""
    events = view.events
    rows = np.flatnonzero(events.kind == _UNREADABLE) if len(events) else ()
    if not len(rows):
        return
    t = np.fromiter((when(view, int(row)) for row in rows), np.int64, len(rows))
    yield _of_events("CAP-003", view, rows, t, lambda k: {"what": _what(view, int(rows[k]))})  # type: ignore[arg-type]


def _what(view: View, row: int) -> str:
    return f"line {int(view.events.line[row])}: {view.events.text(row)}"


@watches("CAP-004")
def lost(view: View) -> Iterator[Occurrence]:
    """Frames that the recorder says it lost."""
    for drop in drops_in(view):
        yield Occurrence("CAP-004", drop.t, drop.bus, None, "", (), {"dropped": drop.frames or "some"})


@dataclass(slots=True)
class _Burst:
    """Error frames of an interface within a second: their times and kinds, and all of them once there are many."""

    times: list[tuple[int, str]] = field(default_factory=list)
    kinds: Counter[str] = field(default_factory=Counter)


class ErrorFrames(Watcher):
    """CAN-004 and BUS-005: error frames, but for those that only say that frames were lost."""

    rules = ("CAN-004", "BUS-005")

    def __init__(self) -> None:
        self._bursts: dict[int, _Burst] = {}

    def look(self, view: View) -> Iterator[Found | Occurrence]:
        """Error frames are rare, or the bus is broken: one by one."""
        events = view.events
        rows = np.flatnonzero(events.kind == _ERROR_FRAME).tolist() if len(events) else []
        if not rows:
            return
        buses = np.where(events.has("bus"), events.bus.astype(np.int64), NO_BUS)
        counted = {name: events.has(name) for name in ("tx_errors", "rx_errors")}
        kinds: dict[str, list[int]] = {}
        most = int(view.number("BUS-005", "errors_per_s"))
        for row in rows:
            error_class, data = int(events.number[row]), events.data(row)
            if overflowed(error_class, data):
                continue
            kind = kind_of(error_class, data)
            kinds.setdefault(kind, []).append(row)
            if events.t[row] != NO_TIME:
                yield from self._follow(int(buses[row]), int(events.t[row]), kind, most)
        for kind, some in kinds.items():
            mine = np.asarray(some)

            def values(k: int, mine: Words = mine, kind: str = kind) -> dict[str, object]:
                row = int(mine[k])
                columns = {"tx_errors": events.tx_errors, "rx_errors": events.rx_errors}
                known = {name: int(column[row]) if counted[name][row] else "?" for name, column in columns.items()}
                return {"kind": kind, **known}

            t = np.fromiter((when(view, row) for row in some), np.int64, len(some))
            yield _of_events("CAN-004", view, mine, t, values)

    def settle(self, _view: View) -> Iterator[Occurrence]:
        """Bursts that go on to the end."""
        for bus, burst in self._bursts.items():
            if burst.kinds:
                yield _many(bus, burst)

    def _follow(self, bus: int, t: int, kind: str, most: int) -> Iterator[Occurrence]:
        burst = self._bursts.setdefault(bus, _Burst())
        if burst.kinds:
            if t <= burst.times[0][0] + SECOND:
                burst.kinds[kind] += 1
                return
            yield _many(bus, burst)
            burst = self._bursts[bus] = _Burst()
        burst.times = [one for one in burst.times if one[0] >= t - SECOND]
        burst.times.append((t, kind))
        if len(burst.times) > most:
            burst.kinds.update(kind for _, kind in burst.times)


def _many(bus: int, burst: _Burst) -> Occurrence:
    kind = max(burst.kinds, key=lambda one: (burst.kinds[one], one))
    values = {"errors": burst.kinds.total(), "kind": kind}
    return Occurrence("BUS-005", burst.times[0][0], bus, None, "", (), values)


def _of_events(rule: str, view: View, rows: Words, t: Words, values: object) -> Found:
    """`Found` for events: they have no frame and no node."""
    none = np.full(len(rows), -1)
    bus = np.where(view.events.has("bus")[rows], view.events.bus[rows].astype(np.int64), NO_BUS)
    return Found(
        rule=rule, t=t, bus=bus, node=none, type=none, frame=none, values=values, frames=lambda _: (),  # type: ignore[arg-type]
    )  # fmt: skip


WATCHERS: tuple[type[Watcher], ...] = (Backwards, Gaps, unreadable, lost, ErrorFrames)
