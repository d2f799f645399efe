"""What the kernel says beside the frames: errors after what can be read, losses where they happened, what it granted.

UDP on the loopback interface drops, counts and fails as SocketCAN does.
"""

from __future__ import annotations

import errno
import socket
from typing import TYPE_CHECKING

import pytest
from kit.rows import batch
from kit.waiting import FOREVER, Pair, classic, columns, longs, lossy_pair, words

from analyzer._native import SocketReceiver, Writer
from analyzer.tables import EVENTS

if TYPE_CHECKING:
    from collections.abc import Iterator

DROP = EVENTS.index("drop")


@pytest.fixture
def lossy() -> Iterator[Pair]:
    with lossy_pair() as made:
        yield made


def test_an_error_is_told_after_what_can_be_read(lossy: Pair) -> None:
    ours, theirs = lossy
    receiver = SocketReceiver(ours.fileno(), "can0", buffer=0)
    for number in (1, 2, 3):
        theirs.send(classic(number))
    theirs.close()
    ours.send(b"")  # refused: the socket has an error now, which the kernel tells before the frames
    assert receiver.receive(FOREVER) == 3
    with pytest.raises(ConnectionRefusedError) as caught:
        receiver.receive(FOREVER)
    assert caught.value.errno == errno.ECONNREFUSED
    assert receiver.receive(0) == 0
    ours.send(b"")
    with pytest.raises(ConnectionRefusedError):
        receiver.receive(FOREVER)
    assert receiver.take().frames == 3


def test_losses_are_told_where_they_happened(lossy: Pair) -> None:
    ours, theirs = lossy
    receiver = SocketReceiver(ours.fileno(), "can0", buffer=0)
    sent = 100
    for number in range(sent):
        theirs.send(classic(number))
    held = sent - receiver.drops_now()
    assert 0 < held < sent
    assert receiver.dropped == 0  # no frame has told it yet
    assert receiver.receive(FOREVER) == held
    theirs.send(classic(1))
    assert receiver.receive(FOREVER) == 2
    assert receiver.dropped == receiver.drops_now() == sent - held
    piece = receiver.take()
    frames, events = piece.columns()
    assert words(frames["line"]) == [*range(1, held + 1), held + 2]
    assert (list(events["kind"]), words(events["class"]), words(events["line"])) == ([DROP], [sent - held], [held + 1])
    assert longs(events["t"]) == longs(frames["t"])[-1:]
    assert piece.lines["frames"] + piece.lines["dropped_frames"] == sent + 1
    writer = Writer("candump")
    again = batch((writer.start() + writer.write(piece)).decode())
    assert columns(again, "text", "text_offset")[1] == columns(piece, "text", "text_offset")[1]
    stamped = ("text", "text_offset")
    assert columns(again, *stamped)[0] == columns(piece, *stamped)[0]
    assert receiver.finish() == 0


def test_losses_that_no_frame_tells_are_told_at_the_end(lossy: Pair) -> None:
    ours, theirs = lossy
    for _ in range(50):
        theirs.send(classic(1))
    receiver = SocketReceiver(ours.fileno(), "can0", buffer=0)  # the counter counts from the opening of the socket
    lost = receiver.drops_now()
    assert receiver.finish() == 50 - lost + 1  # what can be read, too
    assert receiver.finish() == 0
    assert receiver.dropped == receiver.drops_now() == lost
    theirs.send(classic(1))
    assert receiver.receive(FOREVER) == 1
    piece = receiver.take()
    assert piece.lines["frames"] + piece.lines["dropped_frames"] == 51
    events = piece.columns()[1]
    assert events["text"].decode() == f"DROPCOUNT: dropped {lost} CAN frames on 'can0' socket (total drops {lost})"
    assert longs(piece.columns()[0]["t"])[-2] <= longs(events["t"])[0] <= longs(piece.columns()[0]["t"])[-1]


def test_more_buffer_is_asked_for_and_never_less(lossy: Pair) -> None:
    ours, theirs = lossy

    def size(of: socket.socket) -> int:
        return of.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)

    before = size(ours)
    assert SocketReceiver(ours.fileno(), "can0", buffer=0).buffer == size(ours) == before
    assert SocketReceiver(ours.fileno(), "can0", buffer=20_000).buffer == size(ours) == 40_000
    assert SocketReceiver(ours.fileno(), "can0", buffer=10_000).buffer == size(ours) == 40_000
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)  # what anybody is allowed
        granted = SocketReceiver(theirs.fileno(), "can0").buffer
        assert size(other) <= granted == size(theirs) <= 8 << 20
