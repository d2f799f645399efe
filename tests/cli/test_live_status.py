"""The line that a live session writes now and then, and the account at its end: every number in them is true."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING

from kit.waiting import Clock

from analyzer.app.live.status import Status, account
from analyzer.live.interfaces.hub import InterfaceCounts
from analyzer.report import wording

if TYPE_CHECKING:
    from collections.abc import Sequence


def session(frames: int, **counts: InterfaceCounts) -> SimpleNamespace:
    return SimpleNamespace(loop=SimpleNamespace(frames=frames, hub=SimpleNamespace(counts=counts)))


def new(*findings: str, fresh: bool = True) -> Sequence[SimpleNamespace]:
    words = [one.split() for one in findings]
    return [
        SimpleNamespace(fresh=fresh, more=1, finding=SimpleNamespace(severity=severity, rule=rule))
        for severity, rule in words
    ]


def test_a_line_says_what_is_new_since_the_last_one() -> None:
    clock, lines = Clock(), []
    status = Status(60.0, lines.append, lambda: "a.log: 1.0 kB", clock.now)
    clock.seconds += 59.9
    status.look(session(100))
    assert not lines
    status.found(new("error TRF-003", "error TRF-003", "warning BUS-001"))
    status.found(new("error TRF-003", fresh=False))
    clock.seconds += 0.1
    status.look(session(6000, can0=InterfaceCounts(6000, 3, 0), can1=InterfaceCounts(0, 0, 4)))
    status.look(session(6001))
    clock.seconds += 120.0
    status.look(session(12_000, can0=InterfaceCounts(12_000, 5, 0), can1=InterfaceCounts(0, 0, 4)))
    first, second = lines
    assert first.startswith("running for 1 min 0 s; since the last line: 6,000 frames (100/s), 7 dropped, ")
    assert first.endswith(", 2 new errors (TRF-003); 1 new warning (BUS-001), a.log: 1.0 kB")
    assert second.startswith("running for 3 min 0 s; since the last line: 6,000 frames (50/s), 2 dropped, ")
    assert second.endswith(", no new findings, a.log: 1.0 kB")


def test_no_more_rules_are_named_than_fit() -> None:
    clock, lines = Clock(), []
    status = Status(1.0, lines.append, str, clock.now)
    status.found(new("note A-1", "note B-1", "note B-1", "note C-1", "note D-1"))
    clock.seconds += 1.0
    status.look(session(0))
    (line,) = lines
    assert "0 frames (0/s), 0 dropped, 5 new notes (B-1, A-1, C-1, ...)" in line


def test_the_account_adds_up() -> None:
    counts = {"can0": InterfaceCounts(90, 7, 3), "slcan:\x1b": InterfaceCounts(5, errors=2)}
    assert list(account(counts, {"can0"})) == [
        "can0: 100 frames = 90 received + 7 dropped + 3 lost here",
        "slcan:\\x1b: 5 frames = 5 received + 0 dropped, as far as its driver tells; 2 error frames received",
    ]


def test_sizes_in_words() -> None:
    """Units are those of -a and -b."""
    assert [wording.size(n) for n in (0, 999, 1000, 5 * 10**6)] == ["0 bytes", "999 bytes", "1.0 kB", "5.0 MB"]
    assert wording.size(3 * 10**9) == "3.0 GB"
