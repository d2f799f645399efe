"""The proofs of all rules by name, and what a flight with a fault of one of them must show."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from witness import can, push_form, push_values, trf, trf_series, typ_layout, typ_series, typ_values

if TYPE_CHECKING:
    from witness.flights import Flight
    from witness.reader import Log
    from witness.views import Finder

# Of values and packets, in the order of the catalogue.
VALUES: dict[str, Finder] = {
    **typ_layout.FINDERS,
    **typ_values.FINDERS,
    **typ_series.FINDERS,
    **push_form.FINDERS,
    **push_values.FINDERS,
}


def finder(rule: str) -> Finder:
    """What finds breaches of a rule: sets of frame numbers, or of the lines of error frames."""
    if rule in VALUES:
        return VALUES[rule]
    name = "find_" + rule.lower().replace("-", "_")
    return next(getattr(module, name) for module in (can, trf, trf_series) if hasattr(module, name))


def named(rule: str, answer: dict[str, Any]) -> set[int]:
    """What the answer names of what the finder of its rule finds."""
    return set(answer["lines" if rule == "CAN-004" else "frames"])


def prove(rule: str, flight: Flight, usual: int = 0) -> None:
    """Each answer is found, at most `usual` findings are about anything else, and the key says when it was."""
    answers = flight.answers(rule)
    assert answers
    assert flight.unused == ()
    found = finder(rule)(flight.log)
    wanted = [named(rule, answer) for answer in answers]
    for answer, frames in zip(answers, wanted, strict=True):
        assert any(frames & finding for finding in found), answer
        timely(flight.log, answer)
    beside = [finding for finding in found if not any(finding & frames for frames in wanted)]
    assert beside[usual:] == []


def timely(log: Log, answer: dict[str, Any]) -> None:
    """The times of an answer are those of its first and its last line."""
    rows = sorted({*answer["lines"], *(log[number].line for number in answer["frames"])})
    assert (log.lines[rows[0] - 1].t, log.lines[rows[-1] - 1].t) == (answer["t_ns"], answer["t_end_ns"])
