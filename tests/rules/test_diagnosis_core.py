"""The core finds the same causes in random broken traffic as an oracle that looks at it frame by frame."""

from __future__ import annotations

import random
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import encode
from kit.oracle import questions
from kit.oracle.neighbours import Frame, look_around
from kit.oracle.proofs import KnownType
from kit.strategies import examples

from analyzer._native import FrameIndex, diagnose
from analyzer.decode.sent import cells
from analyzer.rules.diagnosis import causes, search
from analyzer.rules.diagnosis.causes import FORMS
from dissectors.kit import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kit.oracle.neighbours import Neighbours

SIGNATURE, OTHER = 0xA9AF28AEA2FBB254, 0xC67490B59FD75681
STARTS = [encode.signature_crc(one) for one in (SIGNATURE, OTHER)]
EXTENDED, ERROR = 1, 4
SESSION, STRANGE = 0x10_040A_0A, 0x10_040A_0B
MILLISECOND = 1_000_000
KNOWN = {"proven": search.PROVEN, "later": search.LATER, "elsewhere": search.ELSEWHERE,
         "misnumbered": search.MISNUMBERED, "lengths": search.LENGTHS}  # fmt: skip


HABITS: list[Callable[[int, int, int], int]] = [  # what becomes of a tail byte: of which frame, of which last one
    *(lambda tail, _at, _last: tail,) * 4,
    lambda tail, at, _last: tail ^ (0x20 if at else 0),
    lambda tail, at, _last: tail | (0x80 if at else 0),
    lambda tail, at, last: tail | (0x40 if at < last else 0),
    lambda tail, at, last: tail & 0xE0 | (tail * (last + 1) + at & 0x1F),
]


class Row(NamedTuple):
    """A frame of a capture; its number is its place."""

    t: int
    identifier: int
    flags: int
    data: bytes


def transfer(payload: bytes, number: int, signature: int) -> list[bytes]:
    one = encode.Transfer("message", 1034, 10, payload, signature, number % 32)
    return [frame.data for frame in one.frames()]


def traffic(chance: random.Random) -> list[Row]:
    """Transfers of one session, each kind of damage now and then, between frames of another one."""
    size = chance.choice((0, 3, 13, 14, 30, 60))
    strangers, wrong, foreign = chance.choice((0.0, 0.3)), chance.choice((0.05, 0.3, 1.0)), chance.choice((0, 0, 0.5))
    habit, varied = chance.choice(HABITS), chance.random() < 0.7
    sent: list[bytes] = []
    for number in range(chance.randrange(3, 40)):
        size_now = max(size + chance.choice((0, 0, 0, 7, -3)), 0)
        content = bytes(chance.choice((0, 1, number) if varied else (0,)) for _ in range(size_now))
        frames = transfer(content, number, OTHER if chance.random() < foreign else SIGNATURE)
        last = len(frames) - 1
        frames = [data[:-1] + bytes([habit(data[-1], k, last)]) for k, data in enumerate(frames)]
        if chance.random() < wrong:
            damage(frames, chance, sent)
        sent += frames
    t, rows = 1_000 * MILLISECOND, list[Row]()
    for data in sent:
        while chance.random() < strangers:
            rows.append(Row(t, STRANGE, EXTENDED, bytes(8)))
        t += chance.choice((1, 1, 1, 1, 700)) * MILLISECOND
        kind = EXTENDED | (ERROR if chance.random() < 0.01 else 0)
        rows.append(Row(NO_TIME if chance.random() < 0.02 else t, SESSION | chance.choice((0, 1 << 26)), kind, data))
    return rows


def damage(frames: list[bytes], chance: random.Random, before: Sequence[bytes]) -> None:
    """Lose, repeat, swap or turn something."""
    at, other = chance.randrange(len(frames)), chance.randrange(len(frames))
    kind = chance.randrange(8)
    if kind == 0 and len(frames) > 1:
        del frames[at]
    elif kind == 1:
        frames.insert(other, frames[at])
    elif kind == 2:
        frames[at], frames[other] = frames[other], frames[at]
    elif kind == 3:
        frames[at] = frames[at][:-1] + bytes([frames[at][-1] ^ 1 << chance.randrange(8)])
    elif kind == 4:
        turned = chance.randrange(len(frames[at]))
        frames[at] = frames[at][:turned] + bytes([frames[at][turned] ^ 4]) + frames[at][turned + 1 :]
    elif kind == 5:
        frames[at] = frames[at][chance.choice((1, 7)) :]
    elif kind == 6:
        frames.insert(at, bytes(chance.randrange(256) for _ in range(8)))
    elif before:
        first = chance.randrange(len(before))
        frames[at:at] = before[first : first + chance.randrange(1, 4)]


def batches(rows: Sequence[Row], cuts: Sequence[int]) -> list[FrameIndex]:
    """The core's view of the frames, cut there."""
    found = []
    for first, end in zip([0, *cuts], [*cuts, len(rows)], strict=True):
        some = rows[first:end]
        offsets = np.cumsum([0, *(len(row.data) for row in some)], dtype=np.int32)
        found.append(
            FrameIndex(
                first, np.array([row.t for row in some], np.int64), np.zeros(len(some), np.uint8),
                np.array([row.identifier for row in some], np.uint32), np.array([row.flags for row in some], np.uint16),
                offsets, np.frombuffer(b"".join(row.data for row in some), np.uint8),
            )
        )  # fmt: skip
    return found


def wanted_of(rows: Sequence[Row], chance: random.Random, *, single: bool) -> list[list[int]]:
    """Lists of frames of the session: those with one ID that follow each other, single ones, and some at random."""
    own = [k for k, row in enumerate(rows) if row.identifier & 0xFF_FFFF == SESSION & 0xFF_FFFF and row.data]
    runs: list[list[int]] = []
    for number in own:
        tail, last = rows[number].data[-1], rows[runs[-1][-1]].data[-1] if runs else -1
        if runs and (tail ^ last) & 0x1F == 0 and not tail & 0x80 and not last & 0x40:
            runs[-1].append(number)
        else:
            runs.append([number])
    some = [sorted(chance.sample(own, min(len(own), 3))) for _ in range(3)] if own else []
    alone = [[number] for number in own]
    return alone if single else [*runs, *alone[::3], *some]


def told(question: int, here: Neighbours | None, times: dict[int, int]) -> questions.Told | str:
    """What the oracle says: words for frames inside of others and copies."""
    if here is None:
        return "gone"
    if question == search.BROKEN:
        return questions.broken(here, times)
    if question == search.CHECKSUM:
        return questions.checksum(here)
    if question == search.REMAINDER:
        return questions.Told(questions.remainder(here))
    if question == search.COPY:
        return "" if questions.is_needed(here) else "copy"
    return questions.inside(here) or ("" if questions.inside(here) is None else "inside")


WHY = {causes.NOTHING: "", causes.FOREIGN_RIGHT: ": a foreign frame, the CRC is right without it",
       causes.FOREIGN: ": a foreign frame", causes.BELONGS: ": it belongs to that one",
       causes.INSIDE: "inside", causes.GONE: "gone"}  # fmt: skip


@pytest.mark.sampled(4)
@pytest.mark.parametrize("question", range(5))
@examples(40)
@given(st.integers(0, 1 << 32))
def test_the_core_finds_what_the_oracle_finds(question: int, seed: int) -> None:
    chance = random.Random(seed)
    rows = traffic(chance)
    lists = wanted_of(rows, chance, single=question in {search.COPY, search.INSIDE})
    starts, size = chance.choice((STARTS[:1], STARTS[:1], STARTS, [])), chance.choice((None, None, 13, 14, 30))
    cuts = sorted(chance.sample(range(len(rows)), min(3, len(rows))))
    offsets = np.cumsum([0, *map(len, lists)], dtype=np.int64)
    asked = np.array([number for some in lists for number in some], np.uint64), offsets
    none = np.zeros(len(lists), np.uint32), np.zeros(len(lists), np.uint8)
    got = diagnose(question, batches(rows, cuts), [(starts, size)], (*asked, *none))
    answers = search.FrameSearch(
        cells(got[0], np.uint8), cells(got[1], np.uint8), cells(got[2], np.int64),
        *((cells(ends, np.int64), cells(numbers, np.uint64)) for ends, numbers in got[3:]),
    )  # fmt: skip
    own = [
        Frame(k, row.t, row.data, row.flags == EXTENDED)
        for k, row in enumerate(rows)
        if row.identifier & 0xFF_FFFF == SESSION & 0xFF_FFFF
    ]
    times = {frame.number: frame.t for frame in own}
    for k, some in enumerate(lists):
        right = told(question, look_around(own, some, KnownType(starts, size)), times)
        form, cause = int(answers.form[k]), answers.cause(k)
        if question == search.COPY and FORMS[form].what == causes.REPEATED:
            assert right == "copy"
        elif isinstance(right, str):
            assert right == (f": {cause.what}{cause.detail}" if cause.what == causes.LATE_COPY else WHY[form])
        else:
            flags = {name for name, bit in KNOWN.items() if answers.flags[k] & bit}
            here = questions.Told(cause if form else None, frozenset(flags), answers.evidence(k), int(answers.value[k]))
            assert here == right._replace(evidence=[*right.evidence])


@examples(40)
@given(st.integers(0, 1 << 32))
def test_the_core_finds_other_transfer_ids_and_the_same_bytes(seed: int) -> None:
    chance = random.Random(seed)
    rows = traffic(chance)
    own = [k for k, row in enumerate(rows) if row.identifier & 0xFF_FFFF == SESSION & 0xFF_FFFF and row.data]
    low, high = sorted(chance.sample(range(len(rows) + 1), 2))
    number, most, among = chance.choice(own), chance.randrange(1, 9), [k for k in own if low <= k < high]
    data, where = rows[number].data, (low, high, 0, SESSION)
    mine = data[-1] & 0x1F
    others = [(k, rows[k].data[-1]) for k in among if rows[k].data[-1] & 0x1F != mine]
    count, alike = len(among[-most:]), [k for k in among[-most:][::-1] if rows[k].data == data]
    whole, *_ = batches(rows, ())
    assert whole.others(*where, mine, most) == others[:most]
    assert whole.alike(*where, data, most) == (count, alike)
    parts = batches(rows, sorted(chance.sample(range(len(rows)), min(3, len(rows)))))
    assert [one for part in parts for one in part.others(*where, mine, len(rows))] == others
    asked = np.array([(*where, mine), (*where, mine + 1), (0, 0, *where[2:], mine)], np.int64).T.copy()
    begins, numbers = (np.frombuffer(column, np.int64).tolist() for column in whole.all_others((*asked,), most))
    each = [[number for number, _ in whole.others(*one, most)] for one in asked.T.tolist()]
    assert [numbers[begin:end] for begin, end in pairwise(begins)] == each


def test_columns_that_do_not_fit_together_are_refused() -> None:
    one = [np.zeros(1, kind) for kind in (np.int64, np.uint8, np.uint32, np.uint16)]
    for offsets, data in (([0], 0), ([0, 1], 0), ([1, 0], 1), ([-1, 0], 1), ([0, 1, 1], 1)):
        with pytest.raises(ValueError, match="columns that do not fit together"):
            FrameIndex(0, *one, np.array(offsets, np.int32), np.zeros(data, np.uint8))
    index = FrameIndex(0, *one, np.array([0, 1], np.int32), np.zeros(1, np.uint8))
    for question, numbers, offsets, type_ in ((9, [0], [0, 1], 0), (0, [0], [0, 2], 0), (0, [0], [0, 1], 1)):
        asked = (np.array(numbers, np.uint64), np.array(offsets, np.int64), np.array([type_], np.uint32))
        with pytest.raises(ValueError, match="questions that do not fit together"):
            diagnose(question, [index], [([], None)], (*asked, np.zeros(1, np.uint8)))
    gone = np.array([5], np.uint64), np.array([0, 1], np.int64), np.zeros(1, np.uint32), np.zeros(1, np.uint8)
    assert cells(diagnose(0, [index], [([], None)], gone)[0], np.uint8).tolist() == [causes.GONE]


@pytest.mark.parametrize("own", [False, True])
def test_what_others_may_write_to_is_copied(own: bool) -> None:
    """A view that nobody may write through shows what is written to the array behind it."""
    columns = [np.zeros(1, kind) for kind in (np.int64, np.uint8, np.uint32, np.uint16)]
    columns += [np.array([0, 1], np.int32), np.zeros(1, np.uint8)]
    views = [column if own else column.view() for column in columns]
    for view in views:
        view.flags.writeable = False
    index = FrameIndex(0, *views)
    before = index.lines([0], ["can0"])
    for column in columns:
        column.flags.writeable = True
        column[:] += 1
    assert index.lines([0], ["can0"]) == before
