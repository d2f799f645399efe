"""What the kernel says beside the frames: errors after what can be read, losses where they happened, what it granted.

UDP on the loopback interface drops, counts and fails as SocketCAN does.
"""

from __future__ import annotations

import errno
import socket
from typing import TYPE_CHECKING

import pytest
from drained import FOREVER, Pair, classic, columns, longs, lossy_pair, read, words

from analyzer._native import Drain, Writer
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
    drain = Drain(ours.fileno(), "can0", buffer=0)
    for number in (1, 2, 3):
        theirs.send(classic(number))
    theirs.close()
    ours.send(b"")  # refused: the socket has an error now, which the kernel tells before the frames
    assert drain.receive(FOREVER) == 3
    with pytest.raises(ConnectionRefusedError) as caught:
        drain.receive(FOREVER)
    assert caught.value.errno == errno.ECONNREFUSED
    assert drain.receive(0) == 0
    ours.send(b"")
    with pytest.raises(ConnectionRefusedError):
        drain.receive(FOREVER)
    assert drain.take().frames == 3


def test_losses_are_told_where_they_happened(lossy: Pair) -> None:
    ours, theirs = lossy
    drain = Drain(ours.fileno(), "can0", buffer=0)
    sent = 100
    for number in range(sent):
        theirs.send(classic(number))
    held = sent - drain.drops_now()
    assert 0 < held < sent
    assert drain.dropped == 0  # no frame has told it yet
    assert drain.receive(FOREVER) == held
    theirs.send(classic(1))
    assert drain.receive(FOREVER) == 2
    assert drain.dropped == drain.drops_now() == sent - held
    piece = drain.take()
    frames, events = piece.columns()
    assert words(frames["line"]) == [*range(1, held + 1), held + 2]
    assert (list(events["kind"]), words(events["class"]), words(events["line"])) == ([DROP], [sent - held], [held + 1])
    assert longs(events["t"]) == longs(frames["t"])[-1:]
    assert piece.lines["frames"] + piece.lines["dropped_frames"] == sent + 1
    writer = Writer("candump")
    again = read((writer.start() + writer.write(piece)).decode())
    assert columns(again, "text", "text_offset")[1] == columns(piece, "text", "text_offset")[1]
    stamped = ("text", "text_offset")
    assert columns(again, *stamped)[0] == columns(piece, *stamped)[0]
    assert drain.finish() == 0


def test_losses_that_no_frame_tells_are_told_at_the_end(lossy: Pair) -> None:
    ours, theirs = lossy
    for _ in range(50):
        theirs.send(classic(1))
    drain = Drain(ours.fileno(), "can0", buffer=0)  # the counter counts from the opening of the socket
    lost = drain.drops_now()
    assert drain.finish() == 50 - lost + 1  # what can be read, too
    assert drain.finish() == 0
    assert drain.dropped == drain.drops_now() == lost
    theirs.send(classic(1))
    assert drain.receive(FOREVER) == 1
    piece = drain.take()
    assert piece.lines["frames"] + piece.lines["dropped_frames"] == 51
    events = piece.columns()[1]
    assert events["text"].decode() == f"DROPCOUNT: dropped {lost} CAN frames on 'can0' socket (total drops {lost})"
    assert longs(piece.columns()[0]["t"])[-2] <= longs(events["t"])[0] <= longs(piece.columns()[0]["t"])[-1]


def test_more_buffer_is_asked_for_and_never_less(lossy: Pair) -> None:
    ours, theirs = lossy

    def size(of: socket.socket) -> int:
        return of.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)

    before = size(ours)
    assert Drain(ours.fileno(), "can0", buffer=0).buffer == size(ours) == before
    assert Drain(ours.fileno(), "can0", buffer=20_000).buffer == size(ours) == 40_000
    assert Drain(ours.fileno(), "can0", buffer=10_000).buffer == size(ours) == 40_000
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)  # what anybody is allowed
        granted = Drain(theirs.fileno(), "can0").buffer
        assert size(other) <= granted == size(theirs) <= 8 << 20
