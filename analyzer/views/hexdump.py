"""`-x`: the bytes of a transfer, frame by frame, with what each of them is for."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer.tables import FD
from analyzer.views.phrases import octets
from analyzer.views.terminal import PLAIN, Palette
from analyzer.window.numbering import Numbering

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.views.frames.window import FrameData, RawFrame

PER_LINE = 16
_CRC_BYTES = 2
_INDENT = " " * 4


class Cut(NamedTuple):
    """A frame's bytes by role."""

    crc: bytes
    payload: bytes
    padding: bytes
    tail: bytes


def cut(frames: Sequence[RawFrame | None], padding: int = 0) -> list[Cut | None]:
    """Return the bytes of a transfer's frames by role, None where a frame is gone.

    `padding` is the number of bytes at the end of the last frame that only fill up a CAN FD frame.
    """
    multi = len(frames) > 1 or any(f is not None and f.data and f.data[-1] & 0xC0 != 0xC0 for f in frames)
    out: list[Cut | None] = []
    for k, frame in enumerate(frames):
        if frame is None:
            out.append(None)
            continue
        body, tail = frame.data[:-1], frame.data[-1:]
        first = multi and bool(tail and tail[0] & 0x80)
        crc = body[:_CRC_BYTES] if first else b""
        rest = body[len(crc) :]
        fill = min(padding, len(rest)) if k == len(frames) - 1 else 0
        out.append(Cut(crc, rest[: len(rest) - fill], rest[len(rest) - fill :], tail))
    return out


def tail_words(tail: int) -> str:
    """Return a tail byte, decoded (4.1.3)."""
    ends = [word for bit, word in ((0x80, "start"), (0x40, "end")) if tail & bit]
    return " ".join([*ends, f"toggle {tail >> 5 & 1}", f"ID {tail & 0x1F}"])


def hexdump(
    places: Sequence[int],
    frame_data: FrameData,
    padding: int = 0,
    palette: Palette = PLAIN,
    numbering: Numbering | None = None,
) -> Iterator[str]:
    """Give lines about the frames of one transfer, given by their places in the capture, from 0.

    Args:
        places: the frames.
        frame_data: gives a frame by its number, None when it is no longer kept.
        padding: bytes of CAN FD padding at the end of the transfer.
        palette: colours; without them the roles are told by labels alone.
        numbering: of the frames; those of the capture if not given.
    """
    frames, numbering = [frame_data(place) for place in places], numbering or Numbering()
    for place, frame, parts in zip(places, frames, cut(frames, padding), strict=True):
        name = f"frame {numbering.of(place)}"
        if frame is None or parts is None:
            yield f"{_INDENT}{name}: its bytes are no longer kept"
            continue
        fd = " FD" if frame.flags & FD else ""
        pieces = [
            (f"{label} " if label else "", role, text)
            for label, role, data in (
                ("crc", "crc", parts.crc),
                ("", "payload", parts.payload),
                ("padding", "padding", parts.padding),
                ("tail", "tail", parts.tail),
            )
            for text in ([octets(data, len(data))] if data else [])
        ]
        if not pieces:
            yield f"{_INDENT}{name}  {frame.id_text}{fd}  no data"
            continue
        words = f"  {tail_words(parts.tail[0])}" if parts.tail else ""
        head = f"{_INDENT}{name}  {frame.id_text}{fd}  "
        yield from _wrapped(head, pieces, words, palette)


def _wrapped(head: str, pieces: list[tuple[str, str, str]], words: str, palette: Palette) -> Iterator[str]:
    """Give one line, or several for the long payloads of CAN FD."""
    line, filled = head, 0
    for k, (label, role, text) in enumerate(pieces):
        line += " | " if k else ""
        line += label
        rest = text.split(" ")
        while rest:
            room = PER_LINE - filled
            if room <= 0:
                yield line.rstrip()
                line, filled, room = " " * len(head), 0, PER_LINE
            now, rest = rest[:room], rest[room:]
            line += palette.paint(role, " ".join(now))
            filled += len(now)
    yield line + words
