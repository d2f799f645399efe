"""A capture as frames and transfers, read by the tail bytes alone (4.1.2, 4.1.3), to be damaged."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from bench.outside.kinds import Case
from kit import encode
from kit.encode import Frame

if TYPE_CHECKING:
    from pathlib import Path
    from random import Random

_LINE = re.compile(r"\((\d+)\.(\d{6,9})\) (\w+) ([0-9A-F]{8})#([0-9A-F]{0,16})( [RT])?")
TWO_SECONDS = 2 * 10**9  # as long a receiver remembers a transfer ID


@dataclass(frozen=True, slots=True)
class Whole:
    """One complete transfer: the places of its frames, and its neighbours in the session by place in `Trace.whole`."""

    places: tuple[int, ...]
    session: int
    before: int | None = None
    after: int | None = None


class Trace:
    """Frames of a capture. Lines that are no classic 29-bit data frame end it: such captures are not used."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.frames = [parse(line) for line in path.read_text().splitlines()]
        self.whole = self._transfers()
        self.text = write(self.frames)

    def _transfers(self) -> list[Whole]:
        opened: dict[int, list[int]] = {}
        found: list[Whole] = []
        last: dict[int, int] = {}
        for place, frame in enumerate(self.frames):
            if not frame.extended or not frame.data:
                continue
            session, tail = frame.id & 0xFFFFFF, frame.data[-1]
            if tail & 0x80:
                opened[session] = []
            if session not in opened:
                continue
            opened[session].append(place)
            if tail & 0x40:
                before, places = last.get(session), tuple(opened.pop(session))
                if before is not None and frame.t - self.frames[found[before].places[0]].t < TWO_SECONDS - 2 * 10**7:
                    found[before] = replace(found[before], after=len(found))
                else:
                    before = None
                last[session] = len(found)
                found.append(Whole(places, session, before))
        return found

    def pick(self, rng: Random, least: int = 1, most: int = 99, *, before: bool = True, after: bool = True) -> Whole:
        """A transfer of so many frames with neighbours, of any session alike; `LookupError` if there is none."""
        fit = [
            one
            for one in self.whole
            if least <= len(one.places) <= most
            and (one.before is not None or not before)
            and (one.after is not None or not after)
            and not one.session & 0x80  # services have rules of their own
            and one.session & 0x7F
        ]
        if not fit:
            raise LookupError("no such transfer")
        session = rng.choice(sorted({one.session for one in fit}))
        return rng.choice([one for one in fit if one.session == session])

    def node(self, one: Whole) -> int:
        return one.session & 0x7F

    def made(self, frames: list[Frame], *nodes: int, about: str = "") -> Case:
        return Case(write(frames), frozenset(nodes), f"{self.path.name} {about}")

    def changed(self, place: int, frame: Frame | None, *nodes: int) -> Case:
        """One frame is another one, or none."""
        with_it = [] if frame is None else [frame]
        frames = [*self.frames[:place], *with_it, *self.frames[place + 1 :]]
        return self.made(frames, self.frames[place].id & 0x7F, *nodes, about=f"frame {place + 1}")

    def inserted(self, place: int, new: list[Frame], *nodes: int) -> Case:
        """Frames that are on the bus before another one, at the time of the one before."""
        t = self.frames[place - 1].t
        frames = [*self.frames[:place], *(replace(one, t=t) for one in new), *self.frames[place:]]
        return self.made(frames, *(one.id & 0x7F for one in new), *nodes, about=f"frame {place + 1}")


def parse(line: str) -> Frame:
    found = _LINE.fullmatch(line)
    if found is None:
        raise ValueError(f"not a classic 29-bit data frame: {line!r}")
    whole, part, bus, number, data, _ = found.groups()
    return Frame(int(number, 16), bytes.fromhex(data), int(whole) * 10**9 + int(part.ljust(9, "0")), bus)


def write(frames: list[Frame]) -> str:
    return "".join(encode.log_line(frame) + "\n" for frame in frames)


def retail(frame: Frame, flip: int) -> Frame:
    """Other bits in the tail byte."""
    return replace(frame, data=frame.data[:-1] + bytes([frame.data[-1] ^ flip]))


def flipped(frame: Frame, byte: int, bits: int) -> Frame:
    data = bytearray(frame.data)
    data[byte] ^= bits
    return replace(frame, data=bytes(data))
