"""Rules of vehicle files that look at frames: of any protocol, remote, error frames; each once, however it is cut."""

from __future__ import annotations

import re
from collections import Counter
from functools import cache
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.judged import judge, outcome, registry
from kit.pages import ROOT
from kit.strategies import examples

import analyzer
from analyzer.decode.engine import Engine
from analyzer.rules.catalogue import load as load_pages
from analyzer.rules.judge import Judge
from analyzer.rules.settings import Settings
from analyzer.rules.vehicle.expected import load

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from analyzer.rules.vehicle.own import OwnRules

FAULTS = (ROOT / "captures/faults.log").read_text(errors="replace")
HEAD = '[rule.ACME-001]\ntitle = "t"\n'
Found = tuple[int | None, str, int]  # node -1: none
LINE = re.compile(r"\((\d+)\.(\d{6})\) can0 ([0-9A-F]{3}|[0-9A-F]{8})#(R?)([0-9A-F]*)(\s|$)")


def own(text: str, folder: Path) -> OwnRules:
    path = folder / "vehicle.toml"
    path.write_text(text)
    found = load(path, load_pages(registry()), registry()).own
    assert found is not None
    return found


def every(text: str, rules: OwnRules, step: int | None = None) -> dict[str, list[Found]]:
    """Node, key and count of what each rule finds."""
    said = judge(text, None, step, own=rules, ignore=tuple(load_pages(registry())))
    return {rule: sorted((one.node, one.key, one.count) for one in said if one.rule == rule) for rule in rules.pages}


def found(text: str, rules: OwnRules, step: int | None = None) -> list[Found]:
    """Return the same of the only one."""
    return every(text, rules, step)["ACME-001"]


def added(some: list[Found]) -> dict[str, int]:
    counts: Counter[str] = Counter()
    for _, key, count in some:
        counts[key] += count
    return dict(counts)


CASES: dict[str, list[Found]] = {
    "can.id == 0x123": [(-1, "of=id 123", 20)],
    "can.id == 0x123 && can.flags.xtd": [],
    "can.id == 0x123 && frame.data[0] >= 05": [(-1, "of=id 123", 15)],
    "can.flags.rtr": [(14, "of=id 1F05340E", 1)],
    "can.flags.rtr && node == 14": [(14, "of=id 1F05340E", 1)],
    "can.flags.rtr && src == 13": [],
    "can.flags.err": [(-1, "of=error frames", 2)],
    "can.flags.err || can.id == 0x123": [(-1, "of=error frames", 2), (-1, "of=id 123", 20)],
    "!can.flags.err && can.id == 0x123": [(-1, "of=id 123", 20)],
}


def test_it_looks_at_every_frame(tmp_path: Path) -> None:
    text = "".join(f'[rule.ACME-{k}]\ntitle = "t"\nwhen = "{when}"\n' for k, when in enumerate(CASES))
    rules = own(text, tmp_path)
    for step in (None, 50):
        assert dict(zip(CASES, every(FAULTS, rules, step).values(), strict=True)) == CASES


def test_every_frame_is_looked_at_once(tmp_path: Path) -> None:
    """Each identifier counts as often as its lines stand in the log, whatever became of the frames."""
    counts = Counter(m[3] for line in FAULTS.splitlines() if (m := LINE.match(line)) and int(m[3], 16) < 1 << 29)
    expected = {f"of=id {name}": count for name, count in counts.items()}
    assert len(expected) > 20
    assert added(found(FAULTS, own(f'{HEAD}when = "can.id >= 0"', tmp_path))) == expected


def test_error_frames_of_a_broken_bus(tmp_path: Path) -> None:
    rules = own(f'{HEAD}when = "can.flags.err"\nfor = "300 ms"', tmp_path)
    text = (ROOT / "captures/bus-break.log").read_text()
    times = [float(line[1:18]) for line in text.splitlines() if " 2000" in line[:32]]
    assert len(times) == 26
    lasting = sum(round(t - times[0], 6) >= 0.3 for t in times)
    assert 0 < lasting < len(times)
    assert found(text, rules) == [(-1, "of=error frames", lasting)]


def test_it_needs_frames_and_no_transfers(tmp_path: Path) -> None:
    rules = own(f'{HEAD}when = "can.id == 0x7"', tmp_path)
    (page,) = rules.pages.values()
    assert page.exercised == "frames"
    words = outcome("(1.000000) can0 123#00\n", own=rules).words
    assert "frames" in words
    assert "transfers" not in words


@pytest.mark.slow
@given(st.integers(30, 900))
@examples(3)
def test_any_cut_gives_the_same(tmp_path_factory: pytest.TempPathFactory, step: int) -> None:
    when = (
        "frame.time_delta > 2 ms || can.flags.err || can.flags.rtr || src == 14 && can.len < 4 || frame.number == 500"
    )
    rules = own(f'{HEAD}when = "{when}"', tmp_path_factory.getbasetemp())
    ignore = tuple(load_pages(registry()))
    whole = judge(FAULTS, None, own=rules, ignore=ignore)
    assert len(whole) > 5
    assert judge(FAULTS, None, step, own=rules, ignore=ignore) == whole  # places and texts, too


def test_a_look_before_the_end_changes_nothing(tmp_path: Path) -> None:
    """A live view asks for what would be the end now and goes on."""
    rules = own(f'{HEAD}when = "can.id == 0x123"\nfor = "1 s"', tmp_path)
    settings = Settings(own=rules, ignore=tuple(load_pages(registry())))
    looked, plain, engine = Judge(registry(), settings), Judge(registry(), settings), Engine(registry())
    lines = FAULTS.encode().splitlines(keepends=True)
    for at in range(0, len(lines), 300):
        for batch in (*engine.feed(b"".join(lines[at : at + 300])), engine.flush()):
            looked.feed(batch)
            plain.feed(batch)
            looked.as_ended()
    counts = [[run.count for _, run in one.finish().runs] for one in (looked, plain)]
    assert counts == [[10], [10]]


Sent = tuple[int, int, bool]  # which identifier, ms since the frame before, whether it is long


@cache
def _lasting(lasts: int, folder: Path) -> OwnRules:
    return own(f'{HEAD}when = "can.len > 1"\nfor = "{lasts} ms"', folder)


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 4000), st.booleans()), max_size=24), st.data())
@examples(20)
def test_what_lasts_is_what_a_plain_loop_says(
    tmp_path_factory: pytest.TempPathFactory, sent: list[Sent], data: st.DataObject
) -> None:
    lasts, step = data.draw(st.sampled_from((1, 500, 2000, 5000))), data.draw(st.integers(1, 7))
    names, ms, lines = ("123", "00000123", "1E058BFE", "7FF"), 0, []
    since: dict[str, tuple[int, int]] = {}
    expected: Counter[str] = Counter()
    for which, after, long in sent:
        ms, name = ms + after, names[which]
        lines.append(f"({1_700_000_000 + ms // 1000}.{ms % 1000:03d}000) can0 {name}#{'00C0' if long else '00'}")
        known = since.pop(name, None)
        if long:
            begun = known[0] if known and ms - known[1] <= max(3000, lasts) else ms
            since[name] = begun, ms
            expected[f"of=id {name}"] += ms - begun >= lasts
    rules = _lasting(lasts, tmp_path_factory.getbasetemp())
    for cut in (None, step):
        assert added(found("\n".join([*lines, ""]), rules, cut)) == {k: n for k, n in expected.items() if n}


def test_everywhere(tmp_path: Path, command: Callable[..., tuple[int, str, str]]) -> None:
    path, log = tmp_path / "vehicle.toml", tmp_path / "winch.log"
    log.write_text("".join(f"(1700000000.{k:06d}) can0 123#0{k}\n" for k in range(6)))
    path.write_text(f'{HEAD}when = "can.id == 0x123 && frame.data[0] > 03"\ntext = "{{can.id}} says {{frame.data}}"')
    given_ = ["--vehicle", str(path), "--select", "ACME"]
    (one,) = analyzer.check(str(log), vehicle=path, select=["ACME"]).findings
    assert (one.rule, one.count, one.text) == ("ACME-001", 2, "0x123 says 04")
    taken = tmp_path / "taken"
    xml = tmp_path / "report.xml"
    command("check", log, *given_, "--extract", taken, "--junit", xml)
    assert 'classname="ACME.' in xml.read_text()
    assert any("123#04" in part.read_text() for part in taken.glob("**/*.log"))
    marked = command(
        "decode", log, "--vehicle", str(path), "--findings", "--frame-list", "-Y", 'finding.rule == "ACME-001"'
    )
    assert marked[1].count("ACME-001") == 2
    assert "can.id == 0x123" in command("explain", "ACME-001", "--vehicle", str(path))[1]
    path.write_text(
        path.read_text() + '\n[[waiver]]\nrule = "ACME-001"\nreason = "old"\nowner = "me"\nexpires = 2099-01-31'
    )
    assert "WAIVED" in {rule.verdict for rule in analyzer.check(str(log), vehicle=path, select=["ACME"]).rules}
