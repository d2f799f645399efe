"""A live session on a terminal: the session runs in a thread of its own, the monitor draws what it leaves for it."""

from __future__ import annotations

import time
from collections import deque
from threading import Thread
from typing import TYPE_CHECKING, Protocol

from analyzer.app.live.lag import BEHIND
from analyzer.app.live.session import SessionView
from analyzer.board.board import Board
from dissectors.kit import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from contextlib import AbstractContextManager

    from analyzer.app.criteria import Criteria
    from analyzer.app.live.session import LiveSession
    from analyzer.board.snapshot import RecordingState, Snapshot
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Measured

# Seconds between two looks whether a session has ended.
_SLICE = 0.2


class Display:
    """Both ends of it: a view for the session, a feed for the monitor.

    Args:
        criteria: types and settings.
        bit_rates: in bits a second by interface, None where nobody knows.
        recording: how the recording goes, None if nothing is recorded.
        save: writes down what there is to report; the line that tells of it.
        stop: ends the session.
        browser: makes what shows rows of what comes from now on.
        clock: nanoseconds since 1970.
    """

    def __init__(
        self,
        criteria: Criteria,
        bit_rates: Mapping[str, int | None],
        recording: Callable[[], RecordingState | None],
        save: Callable[[LiveSession], str],
        stop: Callable[[], None],
        browser: Callable[[], AbstractContextManager[RunningView]],
        clock: Callable[[], int] = time.time_ns,
    ) -> None:
        self._board = Board(criteria.registry, bit_rates)
        self._recording, self._save, self._stop, self._clock = recording, save, stop, clock
        self._wishes: deque[Callable[[LiveSession], str | None]] = deque()
        self._snapshot: Snapshot | None = None
        self._session: LiveSession | None = None
        self._browser, self._inside = browser, False
        self._shown: RunningView | None = None
        self._ended = self.failed = False

    @property
    def ended(self) -> bool:
        """True once the session is over."""
        return self._ended

    @ended.setter
    def ended(self, value: bool) -> None:
        self._ended = value
        if self._shown is not None:
            self._shown.ended = value

    # ---- for the session, in its thread

    def batch(self, measured: Measured) -> None:
        """Take the next batch."""
        self._board.feed(measured.batch, self._clock(), measured.bits)

    def found(self, changes: Sequence[Change]) -> None:
        """Take findings that are new or have come up again."""
        self._board.take_findings(changes, self._clock())

    def note(self, text: str) -> None:
        """Take a note about the session."""
        self._board.note(text, self._clock())

    def look(self, session: LiveSession) -> None:
        """Do what the user wished for, and leave a snapshot."""
        if self._wishes:
            session.catch_up()  # what came before a wish is found before it
        while self._wishes:
            if told := self._wishes.popleft()(session):
                self.note(told)
        for name, count in session.loop.hub.counts.items():
            self._board.take_counts(name, count.received, count.dropped, count.lost)
        self._board.take_recording(self._recording())
        behind = session.loop.behind
        self._board.take_lag(round(behind * SECOND), session.loop.heard.ages() if behind >= BEHIND else {})
        self._snapshot = self._board.snapshot(self._clock())

    # ---- for the monitor, in its thread

    def snapshot(self) -> Snapshot | None:
        """Return the newest state."""
        return self._snapshot

    def mark(self) -> str:
        """Set a mark in the recording; what is latched begins anew."""

        def mark(session: LiveSession) -> None:
            session.mark()
            self._board.mark(self._clock())

        self._wishes.append(mark)
        return "mark set"

    def clear(self) -> str:
        """Forget findings, what is latched, and what is gone."""
        self._wishes.append(lambda _: self._board.clear(self._clock()))
        return "cleared"

    def save(self) -> str:
        """Write the report of now."""
        self._wishes.append(self._save)
        return ""

    def browse(self) -> str:
        """Have the browser shown next."""
        self._inside = True
        return ""

    def stop(self) -> None:
        """Ask the session to end."""
        self._stop()

    def run(self) -> None:
        """Run the monitor, and in between the browser, as often as it is asked for."""
        from analyzer.terminal import run  # noqa: PLC0415 - textual takes its time

        run(self)
        while self._inside and not self._ended:
            self._inside = False
            self._browse()
            run(self)

    def _browse(self) -> None:
        try:
            with self._browser() as self._shown:
                self._shown.run()
        except Exception as error:  # noqa: BLE001 - the monitor is still there
            self.note(f"the browser has ended: {type(error).__name__}: {error}")
        finally:
            self._shown = None


class RunningView(SessionView, Protocol):
    """A view for the session that runs on the terminal of this process, in the main thread."""

    ended: bool

    def run(self) -> None:
        """Show it until the session ends or the user quits. Raises whatever goes wrong."""


def show(session: LiveSession, display: RunningView, instead: SessionView) -> None:
    """Run the session until it ends or the user quits.

    When the display fails, the session goes on with the view `instead`. Raises what ended the session, if it failed.
    """
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
        display.run()
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
