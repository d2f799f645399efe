"""What a rule says of a flight, compared with what the witness finds in its bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from judged import outcome, whole
from witness.proof import finder
from witness.reader import Log

if TYPE_CHECKING:
    from judged import Said

MOST_EXAMPLES = 20  # of a finding
STEP = 401  # lines of a batch


def exact(rule: str, text: str, step: int = STEP) -> list[Said]:
    """The findings of a rule: an occurrence where each proof begins, and no other."""
    said, proofs = whole(text, (rule,), (step,)), _proofs(rule, text)
    begin = sorted(min(proof) for proof in proofs)
    assert sum(one.count for one in said) == len(begin)
    assert sorted(frame for one in said for frame in one.frames) == begin[:MOST_EXAMPLES]
    return said


def proved(rule: str, text: str, step: int = STEP) -> list[Said]:
    """The findings of a rule: each of their places lies in a proof, and each proof has a place in it."""
    said = whole(text, (rule,), (step,))
    _meet([{frame} for one in said for frame in one.frames], _proofs(rule, text))
    return said


def agree(rule: str, text: str) -> None:
    """The evidence of each occurrence has a frame of a proof, and each proof has a frame in evidence."""
    runs = [run for key, run in outcome(text, (rule,)).runs if key.rule == rule]
    _meet([{frame + 1 for frame in example.frames} for run in runs for example in run.examples], _proofs(rule, text))
    assert whole(text, (rule,), (41,))


def _proofs(rule: str, text: str) -> list[set[int]]:
    proofs = [set(proof) for proof in finder(rule)(Log(text))]
    assert proofs
    return proofs


def _meet(shown: list[set[int]], proofs: list[set[int]]) -> None:
    assert all(any(frames & proof for proof in proofs) for frames in shown)
    assert all(any(frames & proof for frames in shown) for proof in proofs)
