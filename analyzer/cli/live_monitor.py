"""A live session on a terminal: the session runs in a thread of its own, the monitor draws what it leaves for it."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass
from threading import Thread
from typing import TYPE_CHECKING

from analyzer.board.board import Board

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from analyzer.board.snapshot import Recording, Snapshot
    from analyzer.cli.judging import Judging
    from analyzer.cli.live_session import LiveSession, View
    from analyzer.report.model import Category, Severity
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Measured

# Seconds between two looks whether a session has ended.
_SLICE = 0.2


@dataclass(frozen=True, slots=True)
class News:
    """What the board is told of a finding; `bus` and `node` are -1 for none, `count` is what is new of it."""

    rule: str
    severity: Severity
    category: Category
    bus: int
    node: int
    type: str
    text: str
    t: int
    count: int
    fresh: bool


class Display:
    """Both ends of it: a view for the session, a feed for the monitor.

    Args:
        judging: types and settings.
        bit_rates: in bits a second by interface, None where nobody knows.
        recording: how the recording goes, None if nothing is recorded.
        save: writes down what there is to report; the line that tells of it.
        stop: ends the session.
        clock: nanoseconds since 1970.
    """

    def __init__(
        self,
        judging: Judging,
        bit_rates: Mapping[str, int | None],
        recording: Callable[[], Recording | None],
        save: Callable[[LiveSession], str],
        stop: Callable[[], None],
        clock: Callable[[], int] = time.time_ns,
    ) -> None:
        self._board = Board(judging.registry, bit_rates, forced=judging.settings.dialects)
        self._recording, self._save, self._stop, self._clock = recording, save, stop, clock
        self._wishes: deque[Callable[[LiveSession], str | None]] = deque()
        self._buses: tuple[str, ...] = ()
        self._snapshot: Snapshot | None = None
        self._session: LiveSession | None = None
        self.ended = self.failed = False

    # ---- for the session, in its thread

    def batch(self, measured: Measured) -> None:
        """The next batch."""
        self._buses = measured.batch.buses
        self._board.add(measured.batch, self._clock(), measured.bits)

    def found(self, changes: Sequence[Change]) -> None:
        """Findings that are new or have come up again."""
        self._board.findings(map(self._news, changes))

    def note(self, text: str) -> None:
        """Something about the session."""
        self._board.note(text, self._clock())

    def look(self, session: LiveSession) -> None:
        """Does what the user wished for, and leaves a snapshot."""
        while self._wishes:
            if told := self._wishes.popleft()(session):
                self.note(told)
        for name, count in session.pump.hub.counts.items():
            self._board.counts(name, count.received, count.dropped, count.lost)
        self._board.recording(self._recording())
        self._snapshot = self._board.snapshot(self._clock())

    def _news(self, change: Change) -> News:
        one = change.finding
        bus = self._buses.index(one.bus) if one.bus in self._buses else -1
        t = one.last.t_ns if one.last.t_ns is not None else self._clock()
        node = -1 if one.node is None else one.node
        text = f"{one.title}: {one.text}"
        return News(one.rule, one.severity, one.category, bus, node, one.type, text, t, change.more, change.fresh)

    # ---- for the monitor, in its thread

    def snapshot(self) -> Snapshot | None:
        """The newest state."""
        return self._snapshot

    def mark(self) -> str:
        """Sets a mark in the recording; what is latched begins anew."""

        def mark(session: LiveSession) -> None:
            session.mark()
            self._board.mark(self._clock())

        self._wishes.append(mark)
        return "mark set"

    def clear(self) -> str:
        """Forgets findings, what is latched, and what is gone."""
        self._wishes.append(lambda _: self._board.clear(self._clock()))
        return "cleared"

    def save(self) -> str:
        """Writes the report of now."""
        self._wishes.append(self._save)
        return ""

    def stop(self) -> None:
        """The session is to end."""
        self._stop()


def show(session: LiveSession, display: Display, instead: View) -> None:
    """Runs the session until it ends or the user quits.

    When the display fails, the session goes on with the view `instead`. Raises what ended the session, if it failed.
    """
    from analyzer.terminal import run  # noqa: PLC0415 - textual takes its time

    failure: list[BaseException] = []

    def work() -> None:
        try:
            session.run()
        except BaseException as error:  # noqa: BLE001 - raised where somebody can deal with it
            failure.append(error)
        finally:
            display.ended = True

    thread = Thread(target=work, name="session", daemon=True)
    thread.start()
    try:
        run(display)
    except Exception as error:  # noqa: BLE001 - the bus is more important than its picture
        session.replace(display, instead, f"the monitor has ended: {type(error).__name__}: {error}")
    else:
        if display.failed:
            session.replace(display, instead, "the monitor has ended")
        else:
            session.stop()
    while thread.is_alive():
        thread.join(_SLICE)  # signals are handled in this thread
    if failure:
        raise failure[0]
