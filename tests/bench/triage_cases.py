"""What `triage_campaign.py` tries: every family of stories in variants that the seed decides, and what is right."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING, Any

from analyzer.simulate.faults import catalogue

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from kit.simulated import simulation, text_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

ESCS, RATES = (4, 6, 8), (10, 30, 50)
# Two motors that work against each other turn over what has few of them.
FEW = dict.fromkeys(("swapped-esc", "swap-flights"), (4, 6))
# How often an option is asked for, half of the time if it is not here, and how often ESCs speak the standard only.
LIKELY, STOCK = {"twin": 0.25, "mute": 0.15}, 0.15
# Some recordings begin in the air: so often, without this share of the lines, if the cause comes behind this share.
LATE, WITHOUT, BEHIND = 0.15, 0.25, 0.4
# Verdicts about one device, which a judge has to name.
OF_DEVICES = {"esc", "propulsion", "wiring", "address", "device", "setup"}
# What is told of the start of a flight may be seen so much before it (ns).
EARLY = 50_000_000


@dataclass(frozen=True, slots=True)
class Case:
    """One capture to judge; of a `late` one the beginning is missing."""

    seed: int
    family: str
    options: tuple[tuple[str, bool], ...]
    escs: int
    rate: int
    stock: bool
    late: bool

    @property
    def scenario(self) -> str:
        """As `--scenario` has it."""
        return ":".join((self.family, *(f"{name}={'yes' if on else 'no'}" for name, on in self.options)))

    @property
    def command(self) -> str:
        """What makes it again, behind `tailbyte simulate -o x.log --key x.json`."""
        stock = " --stock" * self.stock
        late = f" (without the first {WITHOUT:.0%} of the lines)" * self.late
        return f"--scenario {self.scenario} --seed {self.seed} --esc {self.escs} --rate {self.rate}{stock}{late}"

    @property
    def variants(self) -> tuple[str, ...]:
        """The groups that it counts for."""
        asked = (name for name, on in self.options if on)
        return (*asked, *["stock"] * self.stock, *["late"] * self.late, f"{self.escs} ESCs", f"{self.rate} Hz")

    def made(self) -> tuple[str, Mapping[str, Any]]:
        """The capture as candump text, and the story in its key."""
        story = catalogue.scenario(self.family)
        run = simulation(
            story.seconds, scenario=self.scenario, flight=story.flight, seed=self.seed, escs=self.escs, rate=self.rate,
            stock=self.stock,
        )  # fmt: skip
        lines = text_of(run, run.frames()).splitlines(keepends=True)
        key = run.key()["scenario"]
        first = key["first_event"]
        if self.late and (first is None or first["time"] > BEHIND * story.seconds):
            del lines[: round(WITHOUT * len(lines))]
        return "".join(lines), key


def case(seed: int, families: Sequence[str]) -> Case:
    """What a seed is: one family after the other, and dice for the rest."""
    dice, family = Random(f"triage {seed}"), families[seed % len(families)]
    story = catalogue.scenario(family)
    options = tuple((name, dice.random() < LIKELY.get(name, 0.5)) for name in story.options)
    escs = max(dice.choice(FEW.get(family, ESCS)), story.least)
    return Case(seed, family, options, escs, dice.choice(RATES), dice.random() < STOCK, dice.random() < LATE)


@dataclass(frozen=True, slots=True)
class Answer:
    """A judge's verdict; `t_ns` and `t_end_ns` are between which two reports it began, None if it does not say."""

    kind: str
    nodes: tuple[int, ...] = ()
    channels: tuple[int, ...] = ()
    t_ns: int | None = None
    t_end_ns: int | None = None

    @staticmethod
    def of(said: Sequence[Any]) -> Answer:
        """Of (kind, nodes, channels), or with the two times behind them."""
        kind, nodes, channels, *times = said
        return Answer(str(kind), tuple(nodes), tuple(channels), *times)


@dataclass(frozen=True, slots=True)
class Score:
    """`outcome` is right, unknown (that could be known) or wrong; `first` whether the first event is right, if said."""

    outcome: str
    first: bool | None
    healthy_blamed: bool


def score(story: Mapping[str, Any], answer: Answer) -> Score:
    """Measure an answer by the key."""
    cause, first = story["cause"], story["first_event"]
    outcome = "wrong"
    if answer.kind in story["knowable"] and _placed(cause, answer):
        outcome = "right"
    elif answer.kind == "unknown":
        outcome = "unknown"
    timed = None
    if outcome == "right" and first is not None and answer.kind == cause["kind"] and answer.t_end_ns is not None:
        begun = answer.t_end_ns if answer.t_ns is None else answer.t_ns
        timed = begun <= first["t_end_ns"] and answer.t_end_ns >= first["t_ns"] - EARLY
    return Score(outcome, timed, cause["kind"] == "none" and outcome == "wrong")


def _placed(cause: Mapping[str, Any], answer: Answer) -> bool:
    """Whether it names who the cause is about, and nobody else; other verdicts about the same need no place."""
    if not {cause["kind"], answer.kind} <= OF_DEVICES:
        return answer.kind != cause["kind"] or _within(answer, cause)
    return bool(answer.nodes or answer.channels) and _within(answer, cause)


def _within(answer: Answer, cause: Mapping[str, Any]) -> bool:
    pairs = ((answer.nodes, cause["nodes"]), (answer.channels, cause["channels"]))
    return all(set(said) <= set(known) or not known for said, known in pairs)
