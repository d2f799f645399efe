"""Faults of transfer IDs: gaps, repetitions, restarts, one counter for everything."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.simulate.faults.helpers import copied, number, same, sender, telemetry
from dissectors.times import MILLISECOND, SECOND
from dissectors.traffic import Fault, Step

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending

# A counter that was silent for this long may start anywhere.
_FORGOTTEN = 1900 * MILLISECOND
# How long a node's driver surely needs for a transfer, where a later one must not overtake it.
_IN_ORDER = 4 * MILLISECOND


def _gap(case: Case, sending: Sending) -> Step:
    """Lose transfers of one session; the next one shows it."""
    session, lost = same(sending), number(case, "lost")
    if "session" not in case.state:
        last = case.state.setdefault("last", {})
        before, last[session] = last.get(session), sending.t
        if before is None or not _shows(sending, lost, sending.t - before):
            return Step.MORE
        case.state["session"] = session
    if case.state["session"] != session:
        return Step.MORE
    case.mark(sending)
    gone = case.state.setdefault("gone", [])
    if len(gone) == lost:
        first, last = gone[0], gone[-1]
        case.say(
            f"{lost} transfers were not recorded, transfer IDs {first} to {last}; the next has {sending.transfer_id}"
        )
        return Step.DONE
    gone.append(sending.transfer_id)
    for frame in sending.frames:
        frame.lost = True
    return Step.MORE


def _shows(sending: Sending, lost: int, period: int) -> bool:
    """Return if the next transfer tells: it comes in time, its ID is neither the one before nor the next, and not 0."""
    return (lost + 1) * period < _FORGOTTEN and lost % 32 not in {0, 31} and (sending.transfer_id + lost) % 32 != 0


def _again(case: Case, sending: Sending) -> Step:
    frames = sending.frames
    case.say(f"a transfer of {len(frames)} frames was sent twice, transfer ID {sending.transfer_id}")
    sending.frames = [*frames, *copied(frames, sending)]
    return Step.DONE


def _stuck(case: Case, sending: Sending) -> Step:
    """Let the counter stand still once, behind a transfer with another payload."""
    payloads = case.state.setdefault("payloads", {})
    before = payloads.get(same(sending))
    payloads[same(sending)] = sending.payload
    node = case.world.node(sending.node)
    if before is None or before == sending.payload or node is None:
        return Step.SKIP
    node.transfer_ids[sending.message.table, sending.dst] = sending.transfer_id
    sending.transfer_id = (sending.transfer_id - 1) % 32
    case.say(f"two transfers with different payloads have transfer ID {sending.transfer_id}")
    return Step.DONE


def _restarted(case: Case, sending: Sending) -> Step:
    """Restart all counters of the node; but from 1 to 0 a counter would seem to stand still."""
    node = case.world.node(sending.node)
    if node is None or sending.transfer_id < 2:
        return Step.SKIP
    here = (sending.message.table, sending.dst)
    fallen = {key for key, next_id in node.transfer_ids.items() if next_id > 1 and key != here}
    node.transfer_ids.update(dict.fromkeys(fallen, 0))
    case.say(f"all transfer IDs of node {sending.node} restarted from 0, here instead of {sending.transfer_id}")
    node.transfer_ids[here], sending.transfer_id = 1, 0
    until = sending.t + 2 * SECOND

    def first(_: Case, later: Sending) -> Step:
        key = (later.message.table, later.dst)
        if later.node == node.number and later.t <= until and key in fallen and later.message.kind != "response":
            fallen.discard(key)
            case.mark(later)
        return Step.MORE if fallen and later.t <= until else Step.DONE

    case.touch("transfer", first)
    return Step.DONE


def _shared(case: Case) -> None:
    """Use one counter until the end: a driver that counts so does it always."""
    node = sender(case)
    last: list[Sending] = []
    case.say(f"from now on node {node.number} has one transfer ID counter for all its messages")
    case.answer.node = node.number

    def count(_: Case, sending: Sending) -> Step:
        if sending.node == node.number and sending.message.kind == "message":
            if last:
                sending.transfer_id = (last[0].transfer_id + 1) % 32
            case.mark(sending)
        return Step.MORE

    def queue(_: Case, sending: Sending) -> Step:
        """Delay it behind the one before, which a lower identifier would else overtake on the bus."""
        if sending.node == node.number and sending.message.kind == "message":
            if last and last[0].frames and last[0].frames[-1].t < 0:
                wait = max(0, last[0].t + last[0].frames[-1].delay + _IN_ORDER - sending.t)
                for frame in sending.frames:
                    frame.delay += wait
            last[:] = [sending]
        return Step.MORE

    case.touch("transfer", count)
    case.touch("frames", queue)


FAULTS: tuple[Fault, ...] = (
    Fault(
        "TRF-016",
        "transfers are missing, transfer IDs show a gap",
        frames=_gap,
        fits=telemetry,
        options={"lost": 3},
        harmless=True,
        exact=True,
    ),
    Fault("TRF-017", "a transfer is sent twice", frames=_again, fits=telemetry, harmless=True),
    Fault("TRF-018", "the transfer ID is not incremented", transfer=_stuck, fits=telemetry, harmless=True),
    Fault("TRF-019", "transfer IDs restart from 0", transfer=_restarted, fits=telemetry, harmless=True),
    Fault(
        "TRF-020",
        "one transfer ID counter for all types of a node",
        start=_shared,
        also=("TRF-016", "TRF-018", "TRF-019"),
        lasts=2 * SECOND,
    ),
)
