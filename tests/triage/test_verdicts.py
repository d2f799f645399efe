"""What broke first: the sample captures and simulated crashes against their keys, and what is never to be a cause."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from bench.triage_cases import Answer, case, score
from bench.triage_judge import judge
from kit.simulated import simulation, text_of

import analyzer
from analyzer.flight.inquest import inquest
from analyzer.flight.verdict.pages import VERDICTS, verdict_pages
from analyzer.flight.witness import Witness
from analyzer.report.triage import json as as_json
from analyzer.simulate.faults import catalogue

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.flight.verdict.model import Triage

CAPTURES = Path(__file__).resolve().parents[2] / "captures"
KEYS = {path: json.loads(path.read_text()) for path in sorted(CAPTURES.glob("*.key.json"))}
STORIES = {path: key["scenario"] for path, key in KEYS.items() if "cause" in (key.get("scenario") or {})}
# Seeds of the campaign that nothing was tuned on; each is one family in one variant.
SEEDS = range(5000, 5088, 2)


def capture(key: Path) -> Path:
    return next(
        path
        for path in key.parent.glob(f"{key.name.removesuffix('.key.json')}.*")
        if "key" not in path.name and path.suffix in {".log", ".mcap"}
    )


@pytest.mark.parametrize("key", STORIES, ids=lambda path: path.name)
def test_a_sample_capture_is_told_as_its_key_says(key: Path) -> None:
    found = score(STORIES[key], Answer.of(judge(capture(key))))
    assert found.outcome == "right"
    assert found.first is not False


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_no_flight_of_the_campaign_is_told_wrongly(seed: int, tmp_path: Path) -> None:
    one = case(seed, list(catalogue.stories()))
    text, story = one.made()
    path = tmp_path / "crash.log"
    path.write_text(text)
    found = score(story, Answer.of(judge(path)))
    assert found.outcome in {"right", "unknown"}
    assert not found.healthy_blamed


def told(
    tmp_path: Path, scenario: str, seed: int = 3, escs: int = 4, seconds: float | None = None, **more: Any
) -> Triage:
    run = simulation(seconds or catalogue.scenario(scenario).seconds, scenario=scenario, seed=seed, escs=escs, **more)
    path = tmp_path / "crash.log"
    path.write_text(text_of(run, run.frames()))
    return analyzer.triage(path)


@pytest.mark.slow
def test_what_follows_lost_control_is_no_cause(tmp_path: Path) -> None:
    """Near miss of esc, wiring and battery: the same stall, but after the commands went apart."""
    found = told(tmp_path, "motor-stall:twin=yes:tail=yes:distract=no", seed=4)
    assert found.first.kind in {"control", "unknown"}
    assert any(one.sign == "motor" for one in found.after)
    first = told(tmp_path, "motor-stall:twin=no:tail=yes:distract=no", seed=4)
    assert (first.first.kind, first.first.ch) == ("esc", first.primary[0].ch)


@pytest.mark.slow
def test_slow_reports_are_no_proof_of_order(tmp_path: Path) -> None:
    """Near miss of propulsion: at 10 reports a second the current tells too late what came first, or just in time."""
    kinds = {told(tmp_path, "propeller-lost:twin=no:distract=no", seed=seed, rate=10).first.kind for seed in (1, 2, 3)}
    assert kinds <= {"propulsion", "unknown"}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("flight", ["hover", "mission"])
@pytest.mark.parametrize(("seed", "escs"), [(1, 4), (2, 6), (3, 8)])
def test_healthy_motors_are_as_they_were(flight: str, seed: int, escs: int, tmp_path: Path) -> None:
    run = simulation(24, flight=flight, seed=seed, escs=escs)
    path = tmp_path / "good.log"
    path.write_text(text_of(run, run.frames()))
    found = analyzer.triage(path)
    assert [one.text for one in found.events if one.kind == "motor"] == []
    assert found.first.kind in {"none", "unknown"}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("size", [1, 97, 4096])
@pytest.mark.parametrize("name", ["propeller-lost", "deaf-esc", "control-lost", "pack-sag"])
def test_it_does_not_matter_how_batches_are_cut(
    name: str, size: int, decode: Callable[..., Any], registry: Any
) -> None:
    text = (CAPTURES / f"{name}.log").read_bytes()
    lines = text.splitlines(keepends=True)
    answers = []
    for chunks in ([text], [b"".join(lines[k : k + 40 * size]) for k in range(0, len(lines), 40 * size)]):
        witness = Witness(registry)
        frames = 0
        for batch in decode(*chunks).batches:
            witness.feed(batch)
            frames += len(batch.frames)
        found = inquest(
            witness, ["x.log"], ["can0"], start=witness.clock.start, end=witness.clock.last, frames=frames,
            commands=lambda *_: (),
        )  # fmt: skip
        answers.append(as_json.plain(found))
    assert answers[0] == answers[1]


def test_every_kind_has_a_page_and_a_place_in_the_schema() -> None:
    kinds = as_json.schema()["$defs"]["verdict"]["properties"]["kind"]["enum"]
    assert set(kinds) == set(VERDICTS) == set(verdict_pages())
    known = {cause["cause"]["kind"] for cause in STORIES.values()} | {"control"}
    assert known <= set(kinds)


def test_a_vehicle_without_an_esc_is_told_by_its_devices() -> None:
    found = analyzer.triage(CAPTURES / "gps-restart.log")
    assert found.flight is not None
    assert found.flight.by == "arming"
    assert found.first.title.startswith("node 42 (GPS, compass): restarted")
    assert not any("ESC" in one.seen for one in found.excluded)
