"""`tailbyte info`: the facts of a capture for people, and as JSON."""

from __future__ import annotations

import json
import textwrap
from typing import TYPE_CHECKING

from analyzer.tables import VERDICTS
from analyzer.views.info import nodes
from analyzer.views.terminal import escape
from analyzer.views.times import TimeFormat
from dissectors.records import as_dict
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.decode.readings import Statement
    from analyzer.facts.summary import Facts

WIDTH = 80
_LABEL = 11
_IDS, _BUSES = 5, 8
_FOREIGN = VERDICTS[1]


def render(facts: Facts, *, everything: bool = False, types: bool = False, width: int = WIDTH) -> str:
    """Write the summary as text, with the `types` that each node sends if that is wanted.

    Long lists are cut unless `everything` is wanted. Tables have at most `width` columns, texts `WIDTH`.
    """
    lines = [*_head(facts), *_buses(facts, everything), ""]
    lines += nodes.senders(facts, width, everything=everything)
    if types and facts.nodes:
        lines += ["", *nodes.types(facts, width, everything=everything)]
    lines += _unknown(facts, everything)
    lines += _readings(facts)
    lines += _foreign(facts, everything)
    return "\n".join(lines).rstrip() + "\n"


def render_json(facts: Facts) -> str:
    """Write the summary as one JSON object; times are nanoseconds, what is not known is null."""
    content = as_dict(facts)
    if len(facts.files) == 1:
        content = as_dict(facts.files[0]) | content
    content["readings"] = [s._asdict() | {"bus": facts.bus_names[s.bus]} for s in facts.readings]
    content["foreign"] = [{"id": number, "count": count} for number, count in facts.foreign]
    del content["bus_names"]
    return json.dumps(content, indent=2, allow_nan=False) + "\n"


def _head(facts: Facts) -> Iterator[str]:
    for file in facts.files:
        yield from _labelled("File", [f"{escape(file.name)}, {file.form}, {file.size} bytes"])
        yield from _labelled("SHA-256", [file.sha256])
        for note in file.notes:
            yield from _labelled("Note", [escape(note)])
    yield from _labelled("Time", [_span(facts)])
    yield from _labelled("Stamps", [", ".join(facts.stamps) or "none"])
    lines = facts.lines
    events = lines["error_frames"] + lines["drops"] + lines["comments"]
    terms = [
        (lines["frames"], "frames"),
        (events, "events"),
        (lines["unreadable"], "unreadable"),
        (lines["blank"], "blank"),
        (lines["other"], "not CAN"),
        (lines["repeated"], "repeated"),
    ]
    balance = "balanced" if facts.balanced else "NOT BALANCED"
    unit = "Lines" if all(file.unit == "line" for file in facts.files) else "Records"
    yield from _labelled(unit, [f"{lines['lines']} = {_sum(terms)}    {balance}"])
    if events:
        kinds = [
            (lines["error_frames"], "error frames"),
            (lines["drops"], "drop counts"),
            (lines["comments"], "comments"),
        ]
        yield from _labelled("Events", [_sum(kinds)])
    verdicts = [(count, name) for name, count in facts.verdicts.items()]
    yield from _labelled("Frames", [f"{lines['frames']} = {_sum(verdicts)}"])
    yield from _labelled("Transfers", [f"{facts.transfers}, {facts.broken} of them broken"])
    answers = (f"{what} {answer}" for what, answer in facts.judge.items() if what != "stamps")
    yield from _labelled("Can judge", ["  ".join(answers)])


def _sum(terms: Iterable[tuple[int, str]]) -> str:
    """Write the first term always, the others when they are not zero."""
    first, *rest = terms
    return " + ".join(f"{count} {name}" for count, name in [first, *(t for t in rest if t[0])])


def _span(facts: Facts) -> str:
    if facts.start is None or facts.end is None:
        return "not recorded"
    if facts.judge["timing"] != "yes":
        return "of several kinds, which cannot be compared"
    length = duration(facts.end - facts.start)
    if not facts.absolute:
        clock = TimeFormat("e", digits=6)
        return f"{clock.text(facts.start)} s to {clock.text(facts.end)} s (relative), {length}"
    clock = TimeFormat("ad", digits=6)
    start, end = clock.text(facts.start)[:-3], clock.text(facts.end)[:-3]
    day, _, hour = end.partition(" ")
    return f"{start} to {hour if start.startswith(day) else end} (local), {length}"


def duration(ns: int) -> str:
    """Write a length of time in the two or three largest units that say something."""
    seconds, rest = divmod(ns, SECOND)
    if seconds < 60:
        return f"{seconds}.{rest // 1_000_000:03d} s"
    minutes, seconds = divmod(seconds, 60)
    hours, minutes = divmod(minutes, 60)
    return (f"{hours} h " if hours else "") + f"{minutes} min {seconds} s"


def _buses(facts: Facts, everything: bool) -> Iterator[str]:
    shown = facts.buses if everything else facts.buses[:_BUSES]
    for bus in shown:
        words = [f"{bus.frames} frames"]
        if bus.mean is not None:
            words.append(f"mean {bus.mean:.{int(bus.mean < 10)}f}/s")
        if bus.peak is not None:
            words.append(f"peak {bus.peak}/s")
        if bus.load is not None:
            words.append(f"load about {bus.load:.0f} % at 1 Mbit/s")
        yield from _labelled("Bus", [escape(bus.name), ", ".join(words)])
    if len(facts.buses) > len(shown):
        yield from _labelled("", [f"and {len(facts.buses) - len(shown)} more (--all)"])


def _unknown(facts: Facts, everything: bool) -> Iterator[str]:
    """Give types that no dissector knows, most frequent first."""
    found: dict[str, int] = {}
    for node in facts.nodes:
        if not node.known:
            found[node.sends] = found.get(node.sends, 0) + node.count
    if found:
        ranked = sorted(found.items(), key=lambda item: (-item[1], item[0]))
        yield ""
        yield from _labelled("Unknown", [_ranking(ranked, everything)])


def _foreign(facts: Facts, everything: bool) -> Iterator[str]:
    if facts.foreign:
        yield ""
        yield from _labelled(
            "Foreign", [f"{facts.verdicts[_FOREIGN]} frames, ids {_ranking(facts.foreign, everything)}"]
        )


def _ranking(ranked: Iterable[tuple[str, int]], everything: bool) -> str:
    found = list(ranked)
    shown = found if everything else found[:_IDS]
    more = f", and {len(found) - len(shown)} more (--all)" if len(found) > len(shown) else ""
    return ", ".join(f"{name} {count}x" for name, count in shown) + more


def _readings(facts: Facts) -> Iterator[str]:
    """Give one line for each choice that some node makes."""
    if facts.readings:
        yield ""
    groups: dict[tuple[str, str, str, str], list[Statement]] = {}
    for s in facts.readings:
        groups.setdefault((s.message, s.field, s.reading, s.choice), []).append(s)
    for (message, field, reading, choice), statements in groups.items():
        bus = len(facts.buses) > 1
        who = [f"{escape(facts.bus_names[s.bus])}:{s.node}" if bus else str(s.node) for s in statements]
        name = reading if reading == field else f"{field} ({reading})"
        word = "node" if len(who) == 1 else "nodes"
        yield from _labelled("Reading", [f"{message}.{name}: {choice}, {word} {', '.join(who)}"])


def _labelled(label: str, parts: list[str]) -> Iterator[str]:
    text = textwrap.wrap(" ".join(parts), WIDTH - _LABEL, break_on_hyphens=False) or [""]
    for k, line in enumerate(text):
        yield f"{label if k == 0 else '':<{_LABEL}}{line}"
