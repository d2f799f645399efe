"""Laws: what is written of a tree is read as it; columns say what rows say; batches of any size give the same."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import CAPTURES

import dissectors
from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.decode.engine import Batch, Engine
from analyzer.filter import compile_filter
from analyzer.filter.language.parser import parse
from analyzer.filter.language.syntax import (
    Arithmetic,
    BareWord,
    Call,
    Comparison,
    Logic,
    Members,
    Not,
    Number,
    Octets,
    QuotedText,
    Sign,
    Slice,
    SlicePiece,
    Syntax,
    ValueRange,
)  # fmt: skip
from analyzer.tables import KINDS, STATUSES

NAMES = ("can.len", "can.id", "ESCStatus.voltage", "frame.number", "payload", "dronecan.type", "x_1.y")
words = st.sampled_from(NAMES).map(BareWord)
numbers = st.one_of(
    st.integers(0, 10**9).map(lambda n: Number(str(n), n)),
    st.integers(1, 10**6).map(lambda n: Number(f"{n / 1000:.3f}", Fraction(f"{n / 1000:.3f}"))),
    st.tuples(st.integers(1, 99), st.sampled_from(["V", "mV", "degC", "%"])).map(
        lambda p: Number(str(p[0]), p[0], p[1])
    ),
)
texts = st.text('ab \\"(é', max_size=6).map(lambda t: QuotedText(t.replace("\\", "\\\\").replace('"', '\\"')))
octets = st.binary(min_size=2, max_size=4).map(Octets)
places = st.integers(-9, 9)
pieces = st.one_of(
    places.map(lambda k: SlicePiece(k, 1, single=True)),
    st.tuples(places, st.integers(1, 9)).map(lambda p: SlicePiece(*p)),
    places.map(SlicePiece),
    st.tuples(st.integers(0, 4), st.integers(5, 9)).map(lambda p: SlicePiece(p[0], end=p[1])),
)
slices = st.tuples(words, st.lists(pieces, min_size=1, max_size=3).map(tuple)).map(lambda p: Slice(*p))


def _values(inner: st.SearchStrategy[Syntax]) -> st.SearchStrategy[Syntax]:
    pair = st.tuples(st.sampled_from("+-*/%&"), inner, inner)
    calls = st.tuples(st.sampled_from(["max", "len", "abs"]), st.lists(inner, max_size=2).map(tuple))
    return st.one_of(
        pair.filter(lambda p: not (p[0] == "%" and isinstance(p[1], Number))).map(lambda p: Arithmetic(*p)),
        calls.map(lambda p: Call(*p)),
        inner.filter(lambda one: not isinstance(one, Number)).map(Sign),
    )


values = st.recursive(st.one_of(words, numbers, slices), _values, max_leaves=5)
members = st.lists(
    st.one_of(numbers, texts, st.tuples(numbers, numbers).map(lambda p: ValueRange(*p))), min_size=1, max_size=3
).map(lambda some: Members(tuple(some)))
comparisons = st.one_of(
    st.tuples(
        st.sampled_from(["==", "!=", "<", "<=", ">", ">="]), values, st.one_of(values, texts, octets), st.booleans()
    ),
    st.tuples(st.sampled_from(["contains", "matches"]), words, texts, st.booleans()),
    st.tuples(st.just("in"), values, members, st.booleans()),
).map(lambda p: Comparison(*p))


def _conditions(inner: st.SearchStrategy[Syntax]) -> st.SearchStrategy[Syntax]:
    terms = st.lists(inner, min_size=2, max_size=3)

    def logic(pair: tuple[str, list[Syntax]]) -> Syntax:
        op, some = pair
        flat = [t for one in some for t in (one.terms if isinstance(one, Logic) and one.op == op else (one,))]
        return Logic(op, tuple(flat))

    return st.one_of(inner.map(Not), st.tuples(st.sampled_from(["and", "or"]), terms).map(logic))


trees = st.recursive(st.one_of(comparisons, words), _conditions, max_leaves=6)


def written(node: Syntax) -> str:  # noqa: C901, PLR0911, PLR0912 - a line for each kind
    """Return a tree as a filter, with all its parentheses."""
    match node:
        case BareWord(text):
            return text
        case Number(text, _, unit):
            return f"{text} {unit}" if unit else text
        case QuotedText(text, raw):
            return f'{"r" if raw else ""}"{text}"'
        case Octets(value):
            return value.hex(":")
        case ValueRange(low, high):
            return f"{written(low)} .. {written(high)}"
        case Members(items):
            return "{" + ", ".join(map(written, items)) + "}"
        case Slice(of, some):
            return f"{written(of)}[{','.join(map(_piece, some))}]"
        case Call(name, given_):
            return f"{name}({', '.join(map(written, given_))})"
        case Sign(of):
            return f"-({written(of)})"
        case Arithmetic(op, left, right):
            return f"(({written(left)}) {op} ({written(right)}))"
        case Comparison(op, left, right, every):
            return f"({'all' if every else 'any'} {written(left)} {op} {written(right)})"
        case Not(of):
            return f"!({written(of)})"
        case Logic(op, terms):
            return "(" + f" {op} ".join(map(written, terms)) + ")"
    raise AssertionError(node)


def _piece(piece: SlicePiece) -> str:
    if piece.single:
        return str(piece.start)
    if piece.end is not None:
        return f"{piece.start}-{piece.end}"
    return f"{piece.start}:{'' if piece.length is None else piece.length}"


@given(trees)
def test_what_is_written_is_read_as_the_same_tree(tree: Syntax) -> None:
    assert parse(written(tree)) == tree


# ---- columns against rows


@cache
def hover() -> list[Batch]:
    return list(Run(Request((str(CAPTURES / "faults.log"),), threads=1)).batches())


Row = dict[str, list[Any]]


@cache
def rows() -> list[Row]:
    """Every transfer as what it has of each field, the slow way."""
    found: list[Row] = []
    frames = [frame for batch in hover() for frame in batch.frames.to_pylist()]
    for batch in hover():
        esc = {row["transfer"]: row for row in batch.messages["ESCStatus"].to_pylist()}
        raw = {row["transfer"]: row for row in batch.messages["RawCommand"].to_pylist()}
        for number, row in enumerate(batch.transfers.to_pylist(), batch.first_transfer):
            mine = [frames[place] for place in row["frame"]]
            one = esc.get(number)
            found.append({
                "can.id": [frame["id"] for frame in mine],
                "can.len": [len(frame["data"]) for frame in mine],
                "frame.number": [place + 1 for place in row["frame"]],
                "dronecan.src": [row["src"]],
                "dronecan.priority": [row["priority"]],
                "dronecan.status": [STATUSES[row["status"]]],
                "dronecan.kind": [KINDS[row["kind"]]],
                "ESCStatus.rpm": [] if one is None or one["rpm"] is None else [one["rpm"]],
                "ESCStatus.voltage": [] if one is None or one["voltage"] is None else [one["voltage"]],
                "RawCommand.cmd": list(raw[number]["cmd"] or ()) if number in raw else [],
                "len(payload)": [len(row["payload"])],
            })  # fmt: skip
    return found


HOLDS = {
    "==": lambda a, b: a == b, "!=": lambda a, b: a != b, "<": lambda a, b: a < b, "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b, ">=": lambda a, b: a >= b,
}  # fmt: skip
FIELDS = {
    "can.id": st.sampled_from([0x1014040A, 0x1F040A0B, 0x123, 0x1F01550A]), "can.len": st.integers(0, 8),
    "frame.number": st.integers(1, 1970), "dronecan.src": st.integers(0, 127), "dronecan.priority": st.integers(0, 31),
    "ESCStatus.rpm": st.integers(-100, 6000), "ESCStatus.voltage": st.integers(30, 60),
    "RawCommand.cmd": st.integers(-100, 8191), "len(payload)": st.integers(0, 60),
}  # fmt: skip
WORDED = {"dronecan.status": STATUSES, "dronecan.kind": KINDS}


@st.composite
def simple(draw: st.DrawFn) -> tuple[str, Any]:
    """A condition as text, and what it says of a row that is a dictionary."""
    if draw(st.booleans()) and draw(st.booleans()):
        name = draw(st.sampled_from(sorted(WORDED)))
        op, value = draw(st.sampled_from(["==", "!="])), draw(st.sampled_from(WORDED[name]))
        text = f'{name} {op} "{value}"'
    else:
        name = draw(st.sampled_from(sorted(FIELDS)))
        op, value = draw(st.sampled_from(sorted(HOLDS))), draw(FIELDS[name])
        if draw(st.booleans()) and name != "len(payload)":
            high = value + draw(st.integers(0, 50))
            return f"{name} in {{{value}..{high}}}" if name in (
                "RawCommand.cmd",
                "ESCStatus.rpm",
            ) else f"{name} == {value}", (
                (lambda row: any(value <= one <= high for one in row[name]))
                if name in ("RawCommand.cmd", "ESCStatus.rpm")
                else (lambda row: value in row[name])
            )
        text = f"{name} {op} {value}"
    quantifier = draw(st.sampled_from(["", "any ", "all "]))
    every = quantifier == "all " or (not quantifier and op == "!=")

    def holds(row: Row) -> bool:
        found = [HOLDS[op](one, value) for one in row[name]]
        return bool(found) and (all(found) if every else any(found))

    return quantifier + text, holds


def _joined(inner: st.SearchStrategy[tuple[str, Any]]) -> st.SearchStrategy[tuple[str, Any]]:
    def both(pair: list[tuple[str, Any]]) -> tuple[str, Any]:
        (a, one), (b, other) = pair
        return f"({a}) && ({b})", lambda row: one(row) and other(row)

    def either(pair: list[tuple[str, Any]]) -> tuple[str, Any]:
        (a, one), (b, other) = pair
        return f"({a}) || ({b})", lambda row: one(row) or other(row)

    pairs = st.lists(inner, min_size=2, max_size=2)
    return st.one_of(
        pairs.map(both), pairs.map(either), inner.map(lambda p: (f"!({p[0]})", lambda row, of=p[1]: not of(row)))
    )


@given(st.recursive(simple(), _joined, max_leaves=5))
def test_columns_say_what_rows_say(condition: tuple[str, Any]) -> None:
    text, holds = condition
    matcher = compile_filter(text, dissectors.load()).matcher()
    found = [bool(one) for batch in hover() for one in matcher.feed(batch).transfers]
    assert found == [holds(row) for row in rows()], text


STATEFUL = [
    "ESCStatus.temperature_celsius - lag(ESCStatus.temperature_celsius, 200 ms) > 0",
    "ESCStatus.rpm != lag(ESCStatus.rpm, 50 ms)", "ch == 2", "frame.time_delta > 1 ms", "can.len < 8 && node == 11",
    "frame.time_relative > 0.5 and unit == 1", "frame.data[0] == 00", "!can.id", "can.flags.rtr || can.flags.err",
]  # fmt: skip


@pytest.mark.sampled(4)
@pytest.mark.parametrize("text", STATEFUL)
@pytest.mark.parametrize("size", [2500, 9000])
def test_batches_of_any_size_give_the_same(text: str, size: int) -> None:
    data = (CAPTURES / "faults.log").read_bytes()

    def chosen(step: int) -> list[list[Any]]:
        engine, found = Engine(dissectors.load()), [[], [], []]
        matcher = compile_filter(text, engine.registry).matcher()
        pieces = [data[k : k + step] for k in range(0, len(data), step)]
        for piece in [*pieces, None]:
            batches = [*list(engine.feed(piece)), engine.flush()] if piece is not None else list(engine.end())
            for batch in batches:
                masks = matcher.feed(batch).selected()
                first = batch.first_frame
                found[0] += [batch.transfers.column("frame")[k].as_py()[0] for k in masks.transfers.nonzero()[0]]
                found[1] += [first + int(k) for k in masks.frames.nonzero()[0]]
                found[1] += [batch.settled.column("frame")[int(k)].as_py() for k in masks.settled.nonzero()[0]]
                found[2] += [batch.events.column("line")[int(k)].as_py() for k in masks.events.nonzero()[0]]
        return [sorted(some) for some in found]

    whole = chosen(len(data))
    assert any(whole) or text == "can.flags.rtr || can.flags.err"
    if "delta" in text:  # the row before is that of a list, which gives transfers as they end
        return
    assert chosen(size) == whole


@pytest.mark.parametrize("size", [2500, 9000, 92_620])
def test_a_frame_of_a_list_counts_from_the_one_before_whenever_its_transfer_ends(size: int) -> None:
    data, engine = (CAPTURES / "hover.log").read_bytes(), Engine(dissectors.load())
    matcher = compile_filter("frame.time_delta >= 500 us", engine.registry).matcher(frame_list=True)
    found: set[int] = set()
    times: list[int] = []
    for piece in [*(data[k : k + size] for k in range(0, len(data), size)), None]:
        for batch in [*engine.feed(piece), engine.flush()] if piece is not None else engine.end():
            matches = matcher.feed(batch)
            places, wanted = matches.members
            found |= set(places[wanted].tolist())
            found |= {batch.first_frame + int(k) for k in matches.frames.nonzero()[0]}
            times += batch.frames.column("t").cast("int64").to_pylist()
    assert found == {k for k in range(1, len(times)) if times[k] - times[k - 1] >= 500_000}
