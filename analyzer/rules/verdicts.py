"""Verdicts of the rules: broken, kept, not exercised, or beyond what the recording can show."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Literal, get_args

from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from analyzer.facts.summary import Facts
    from analyzer.rules.catalogue import Page

Verdict = Literal["FAIL", "WARN", "WAIVED", "KNOWN", "INCONCLUSIVE", "PASS", "NOT EXERCISED"]
Excused = Literal["", "waived", "known"]
RANKED: tuple[Verdict, ...] = get_args(Verdict)  # the worst first
UNJUDGED: tuple[Verdict, ...] = ("NOT EXERCISED", "INCONCLUSIVE")

TIMES = "times"
# Why a rule cannot be judged without it, by the words of `catalogue.PROOFS`.
_MISSING = {
    TIMES: "times not recorded",
    "drops": "drops not recorded",
    "errors": "error frames not recorded",
    "bit rate": "bit rate not given (--bitrate)",
    "hardware times": "no hardware times",
    "end": "the end of the recording is not in the window",
}
_EITHER = {"bit rate", "hardware times"}  # where a page names both, one of them is enough
COARSE = "times too coarse"
_LOST = "frames were lost or not recorded there"


@dataclass(frozen=True, slots=True)
class RatedFinding:
    """A finding as far as a verdict needs it. `excused`: somebody has waived it, or an older report has it too."""

    rule: str
    severity: str
    excused: Excused = ""


@dataclass(frozen=True, slots=True)
class RatedCapture:
    """One capture: its findings, what it exercised, and which proofs it has; `coarse` times are none."""

    breaches: Sequence[RatedFinding]
    words: Collection[str]
    proofs: Collection[str]
    lossy: bool = False
    coarse: bool = False


@dataclass(frozen=True, slots=True)
class Ruling:
    """The verdict of a rule over all captures; `needs` is the expression that no capture met."""

    verdict: Verdict
    findings: int = 0
    reason: str = ""
    needs: str = ""


@dataclass(slots=True)
class _Tally:
    """The findings of one rule."""

    severities: Counter[str] = field(default_factory=Counter)
    excused: Counter[str] = field(default_factory=Counter)
    lost: int = 0
    doubt: str = ""

    @property
    def count(self) -> int:
        return self.severities.total() + self.excused.total() + self.lost


def proofs_of(facts: Facts, bit_rate: int | None, *, coarse: bool = False, ends: bool = True) -> frozenset[str]:
    """Return what a capture records of all that rules may want as proof; `coarse` times prove nothing.

    `ends`: the end of what is judged is that of the recording.
    """
    found = {
        TIMES: facts.judge.get("timing") == "yes" and not coarse,
        "drops": facts.judge.get("drops") == "yes",
        "errors": facts.judge.get("errors") == "yes",
        "bit rate": bit_rate is not None,
        "end": ends,
        "hardware times": not coarse and any("hardware" in stamp for stamp in facts.stamps),
    }
    return frozenset(word for word, there in found.items() if there)


def met(expression: str, words: Collection[str]) -> bool:
    """Return whether `a, b|c` holds: "," is and, "|" is or, which binds less."""
    return any(all(word.strip() in words for word in group.split(",")) for group in expression.split("|"))


def lacking(page: Page, proofs: Collection[str]) -> list[str]:
    """Return the proofs that a page wants and a capture does not have."""
    wanted = set(page.inconclusive)
    if wanted >= _EITHER and not _EITHER.isdisjoint(proofs):
        wanted -= _EITHER
    return [proof for proof in page.inconclusive if proof in wanted and proof not in proofs]


def rulings(pages: Mapping[str, Page], enabled: Collection[str], captures: Sequence[RatedCapture]) -> dict[str, Ruling]:
    """Return the verdict of every rule, in the order of the pages."""
    tallies = _tallies(pages, captures)
    return {rule: _ruling(page, rule in enabled, tallies.get(rule), captures) for rule, page in pages.items()}


def _tallies(pages: Mapping[str, Page], captures: Iterable[RatedCapture]) -> dict[str, _Tally]:
    found: dict[str, _Tally] = {}
    for capture in captures:
        for one in capture.breaches:
            if (tally := found.get(one.rule)) is None:
                tally = found[one.rule] = _Tally()
            if one.excused == "waived" or (one.excused and one.severity != "note"):
                tally.excused[one.excused] += 1
            elif one.severity == "note" and (doubt := _doubt(pages[one.rule], capture)):
                tally.lost += 1
                tally.doubt = doubt
            else:
                tally.severities[one.severity] += 1
    return found


def _ruling(page: Page, enabled: bool, tally: _Tally | None, captures: Sequence[RatedCapture]) -> Ruling:
    if not enabled:
        return Ruling("NOT EXERCISED", reason="not selected" if page.enabled else "off unless selected")
    if tally is not None:
        return _broken(tally)
    exercised = [capture for capture in captures if met(page.exercised, capture.words)]
    if not exercised:
        return Ruling("NOT EXERCISED", needs=page.exercised)
    missing = [lacking(page, capture.proofs) for capture in exercised]
    if all(missing):
        return Ruling("INCONCLUSIVE", reason=", ".join(_why(proof, exercised[0]) for proof in missing[0]))
    unproven = sum(map(bool, missing))
    reason = f"inconclusive in {unproven} of {len(exercised)} captures" if unproven else ""
    return Ruling("PASS", reason=reason)


def _doubt(page: Page, capture: RatedCapture) -> str:
    """Return why what is found proves nothing there; nothing if it does."""
    if capture.coarse and TIMES in page.inconclusive:
        return COARSE
    return _LOST if capture.lossy and page.drops else ""


def _why(proof: str, capture: RatedCapture) -> str:
    return COARSE if proof == TIMES and capture.coarse else _MISSING.get(proof, proof)


def _broken(tally: _Tally) -> Ruling:
    excused = ", ".join(f"{count} {word}" for word, count in sorted(tally.excused.items(), reverse=True))
    if tally.severities["error"]:
        return Ruling("FAIL", tally.count, excused)
    if tally.severities["warning"]:
        return Ruling("WARN", tally.count, excused)
    if tally.excused:
        return Ruling("WAIVED" if tally.excused["waived"] else "KNOWN", tally.count, excused)
    if tally.lost:
        return Ruling("INCONCLUSIVE", tally.count, tally.doubt)
    return Ruling("PASS", tally.count, "notes only")
