"""A frame that comes again, late, behind its transfer or inside a later one, is called a copy of what it was."""

from __future__ import annotations

import pytest
from kit.judged import whole
from kit.traffic import MS, SECOND, START, at, lines, push, retail, status

RULES = ("TRF-003", "TRF-004", "TRF-005", "TRF-006", "TRF-009", "TRF-026")
COPIED = 20  # the number of the transfer of which a frame comes again


def capture(which: int, before: int, later: int, flip: int = 0) -> tuple[str, int]:
    """Transfers of three frames, 10 ms apart, and the number (from 1) of the frame that comes again."""
    sent = [
        [at(SECOND * 3 + k * 10 * MS + n * MS, one) for n, one in enumerate(status(k % 32, rpm=k).frames())]
        for k in range(40)
    ]
    inside, again = sent[COPIED + later], sent[COPIED][which]
    inside.insert(before, at(inside[before].t - START - MS // 2, retail(again, flip)))
    return lines([one for own in sent for one in own]).decode(), COPIED * 3 + which + 1


@pytest.mark.sampled(5)
@pytest.mark.parametrize("later", [1, 2, 5])
@pytest.mark.parametrize("before", [0, 1, 2])
@pytest.mark.parametrize("which", [0, 1, 2])
def test_a_late_copy_is_called_one(which: int, before: int, later: int) -> None:
    text, number = capture(which, before, later)
    found = whole(text, RULES, (7,))
    if (which, before, later) == (2, 0, 1):  # the very next frame
        assert [(one.rule, one.text) for one in found] == [("TRF-004", f"frame {number + 1} repeats frame {number}")]
        return
    alone = "TRF-006" if which == 0 else "TRF-009" if before else "TRF-005"
    assert {one.rule for one in found} == ({alone, "TRF-026"} if before else {alone})
    assert all(f"a late copy of frame {number}" in one.text for one in found)


@pytest.mark.parametrize("before", [0, 1])
def test_what_differs_in_a_bit_is_no_copy(before: int) -> None:
    text, _ = capture(1, before, 1, flip=0x20)
    assert {"a late copy" in one.text for one in whole(text, RULES, (7,))} == {False}


def test_what_belongs_to_no_whole_transfer_has_no_copy() -> None:
    """The last frame of a transfer that was cut itself comes twice."""
    frames = [one for k in range(30) for one in push(k).frames()]
    cut = [*frames[:51], frames[54], *frames[55:57], frames[54], *frames[57:]]
    found = whole(lines(cut).decode(), RULES[:-1], (7,))
    assert found
    assert {"a late copy" in one.text for one in found} == {False}
