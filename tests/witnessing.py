"""Findings against the witness by their evidence: each one is proved, and nothing that is proved is missing."""

from __future__ import annotations

from judged import judge, outcome
from witness.proof import finder
from witness.reader import Log


def agree(rule: str, text: str, *, more: int = 0) -> None:
    """All but `more` of a rule's occurrences show a frame of a proof, each proof is shown, in batches of any size."""
    shown = [
        {frame + 1 for frame in example.frames}
        for key, run in outcome(text, (rule,)).runs
        if key.rule == rule
        for example in run.examples
    ]
    proofs = finder(rule)(Log(text))
    assert proofs
    assert all(any(proof & frames for frames in shown) for proof in proofs)
    assert sum(not any(proof & frames for proof in proofs) for frames in shown) == more
    assert judge(text, (rule,), step=41) == judge(text, (rule,))
