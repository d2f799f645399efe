"""Laws: how often hypothesis tries one, and strategies for traffic that is valid on paper, then damaged.

A law is tried a fifth as often in the fast run, as often as it says with `--all-examples`.

Random bytes hardly ever reach a wrong toggle or a late frame; traffic that was valid a moment ago does. `captures()`
gives the bytes of a candump log together with what was sent and what was done to it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from kit import encode
from kit.encode import Frame, Transfer

if TYPE_CHECKING:
    from collections.abc import Callable

SAMPLE, FEW = 20, 5
# No law depends on how fast a machine is, nor whether it can be tried there.
_CALM = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.function_scoped_fixture]
settings.register_profile("sample", deadline=None, suppress_health_check=_CALM, max_examples=SAMPLE)
settings.register_profile("all", deadline=None, suppress_health_check=_CALM, max_examples=100)


def examples(count: int, **more: Any) -> settings:
    """Return settings for a law that is tried `count` times, or a fifth of that in the fast run."""
    everything = settings.get_current_profile_name() == "all"
    return settings(max_examples=count if everything else min(count, max(FEW, count // 5)), **more)


MS, US = 1_000_000, 1000
START = 1_700_000_000 * 10**9
MESSAGES = sorted(n for n, of in encode.TYPES.items() if of.kind == "message")
SERVICES = sorted(n.removesuffix(".Request") for n, of in encode.TYPES.items() if of.kind == "request")
ALLOCATION = "uavcan.protocol.dynamic_node_id.Allocation"
UNKNOWN = {20710: 0x0123456789ABCDEF, 999: 0xFEDCBA9876543210, 64001: 0x1122334455667788}  # type id -> signature


def fields_of(name: str, *, finite: bool = True) -> st.SearchStrategy[dict[str, Any]]:
    """Values for a type of `encode.TYPES` that its bits hold exactly; with `finite=False` also NaN and infinity."""
    return _record(encode.TYPES[name].layout, finite)


def _record(layout: str, finite: bool) -> st.SearchStrategy[dict[str, Any]]:
    union, fields = encode.parse(layout)
    parts = {name: _field(base, size, how, finite) for name, base, size, how in fields if name}
    if union:
        return st.one_of([st.fixed_dictionaries({name: part}) for name, part in parts.items()])
    return st.fixed_dictionaries(parts)


def _field(base: str, size: int, how: str, finite: bool) -> st.SearchStrategy[Any]:
    if base in encode.RECORDS:
        one = _record(encode.RECORDS[base], finite)
    else:
        kind, width = base[0], int(base[1:])
        one = {
            "f": st.floats(width=width if kind == "f" else 64, allow_nan=not finite, allow_infinity=not finite),
            "u": st.integers(0, 2**width - 1),
            "i": st.integers(-(2 ** (width - 1)), 2 ** (width - 1) - 1),
        }[kind]
    if not how:
        return one
    return st.lists(one, min_size=0 if how == "dynamic" else size, max_size=size)


@dataclass(eq=False)
class Sent:
    """One transfer that a node sent, and what became of it on the way into the file."""

    transfer: Transfer
    name: str | None  # None: of a type that nobody knows
    fields: dict[str, Any] | None
    bus: str
    frames: list[Frame]
    damage: set[str] = field(default_factory=set)  # what was done to its own frames
    lines: list[int] = field(default_factory=list)  # 1-based lines that its frames stand in, damaged or not
    calm: bool = True  # nothing was done to any transfer of its session

    @property
    def session(self) -> tuple[object, ...]:
        of = self.transfer
        return (self.bus, of.kind, of.type_id, of.src, of.dst)


@dataclass(eq=False)
class Row:
    """One line to be: a frame, or a text that is none. `owner` sent it."""

    t: int
    frame: Frame | None
    owner: Sent | None = None
    text: bytes = b""


@dataclass(eq=False)
class Capture:
    data: bytes
    sent: list[Sent]
    lines: int  # of `data`, a last one without newline included
    damage: list[str]

    def __repr__(self) -> str:
        return f"<{self.damage} of {len(self.sent)} transfers:\n{self.data.decode('latin-1')}>"


@st.composite
def sessions(draw: st.DrawFn, bus: str, fd: bool) -> list[Sent]:
    """The transfers of one session (a service: of both directions), in time and with ids that count up by one."""
    what = draw(st.sampled_from(["message", "message", "message", "unknown", "service", "anonymous"]))
    src, dst = draw(st.permutations(range(1, 128)))[:2] if what == "service" else (draw(st.integers(1, 127)), None)
    name = draw(st.sampled_from(SERVICES if what == "service" else MESSAGES))
    unknown, signature = draw(st.sampled_from(sorted(UNKNOWN.items())))
    size = draw(st.sampled_from([3, 20]))
    more = {"priority": draw(st.integers(0, 31)), "fd": fd}
    first, out, t = draw(st.integers(0, 31)), [], START + draw(st.integers(0, 500)) * MS

    def add(part: Transfer, name: str | None, fields: dict[str, Any] | None) -> None:
        nonlocal t
        frames = part.frames(t, draw(st.integers(100, 3000)) * US, bus)
        out.append(Sent(part, name, fields, bus, frames))
        t = frames[-1].t + draw(st.integers(100, 600_000)) * US

    for transfer_id in range(first, first + draw(st.integers(1, 4))):
        if what == "unknown":
            payload = draw(st.binary(min_size=size, max_size=size))
            add(Transfer("message", unknown, src, payload, signature, transfer_id % 32, **more), None, None)
        elif what == "service":
            for kind, a, b in ((".Request", src, dst), (".Response", dst, src)):
                fields = draw(fields_of(name + kind, finite=False))
                add(encode.transfer(name + kind, fields, a, transfer_id, dst=b, **more), name + kind, fields)
        elif what == "anonymous":
            fields = draw(fields_of(ALLOCATION))
            fields["unique_id"] = fields["unique_id"][:5]
            part = encode.transfer(ALLOCATION, fields, 0, transfer_id, kind="anonymous", **more)
            add(part, ALLOCATION, fields)
        else:
            fields = draw(fields_of(name, finite=False))
            add(encode.transfer(name, fields, src, transfer_id, **more), name, fields)
    return out


@st.composite
def traffic(draw: st.DrawFn, max_sessions: int = 5) -> list[Sent]:
    """Valid traffic of several nodes on one or two buses, each CAN FD or not; no two sessions share a key."""
    buses = {name: draw(st.booleans()) for name in draw(st.sampled_from([["can0"], ["can0", "vcan-1.x"]]))}
    by_key: dict[tuple[object, ...], Sent] = {}
    out = []
    for _ in range(draw(st.integers(1, max_sessions))):
        bus = draw(st.sampled_from(sorted(buses)))
        part = draw(sessions(bus, buses[bus]))
        if not any(one.session in by_key for one in part):
            by_key |= {one.session: one for one in part}
            out += part
    return out


def _touch(row: Row, how: str) -> None:
    if row.owner:
        row.owner.damage.add(how)


def _change(how: str, change: Callable[[st.DrawFn, Frame], Frame]) -> Callable[[st.DrawFn, list[Row], int], None]:
    """A damage to the frame of one row."""

    def apply(draw: st.DrawFn, rows: list[Row], at: int) -> None:
        row = rows[at]
        if row.frame and row.frame.data:
            row.frame = change(draw, row.frame)
            _touch(row, how)

    return apply


def _flip(mask: st.SearchStrategy[int]) -> Callable[[st.DrawFn, Frame], Frame]:
    return lambda draw, f: replace(f, data=f.data[:-1] + bytes([f.data[-1] ^ draw(mask)]))


def _corrupt(draw: st.DrawFn, frame: Frame) -> Frame:
    data = bytearray(frame.data)
    data[draw(st.integers(0, len(data) - 1))] ^= draw(st.integers(1, 255))
    return replace(frame, data=bytes(data))


def _shorten(draw: st.DrawFn, frame: Frame) -> Frame:
    shorter = [n for n in encode.DLC_LENGTHS if n < len(frame.data)]
    return replace(frame, data=frame.data[: draw(st.sampled_from(shorter))])


def _drop(_: st.DrawFn, rows: list[Row], at: int) -> None:
    _touch(rows.pop(at), "drop")


def _duplicate(_: st.DrawFn, rows: list[Row], at: int) -> None:
    _touch(rows[at], "duplicate")
    rows.insert(at, replace(rows[at]))


def _swap(_: st.DrawFn, rows: list[Row], at: int) -> None:
    """Exchange two neighbours; the stamps stay in order."""
    one, two = rows[at], rows[min(at + 1, len(rows) - 1)]
    one.t, two.t = two.t, one.t
    rows[at : at + 2] = [two, one] if one is not two else [one]
    _touch(one, "swap")
    _touch(two, "swap")


def _pause(draw: st.DrawFn, rows: list[Row], at: int) -> None:
    """More than the 2 s that a transfer may take, before row `at`."""
    for row in rows[:at]:
        if any(late.owner is row.owner for late in rows[at:]):
            _touch(row, "pause")
    wait = draw(st.integers(2001, 9000)) * MS
    for row in rows[at:]:
        row.t += wait


def _insert(frame: st.SearchStrategy[Frame | bytes]) -> Callable[[st.DrawFn, list[Row], int], None]:
    def apply(draw: st.DrawFn, rows: list[Row], at: int) -> None:
        new = draw(frame)
        t = rows[at].t
        rows.insert(at, Row(t, None, text=new) if isinstance(new, bytes) else Row(t, new))

    return apply


_ids, _small = st.integers(0, 2**29 - 1), st.binary(max_size=8)
_broken = [b"(1.5) can0", b"can0 1F040601 [x] C0", b"(1700000000.000000) can0 1F040601#C", b"(x) can0 1F040601#C0"]
_line = st.binary(max_size=60).map(lambda b: b.replace(b"\n", b"").replace(b"\r", b""))
DAMAGE: dict[str, Callable[[st.DrawFn, list[Row], int], None]] = {
    "drop": _drop,
    "duplicate": _duplicate,
    "swap": _swap,
    "toggle": _change("toggle", _flip(st.just(0x20))),
    "start": _change("start", _flip(st.just(0x80))),
    "end": _change("end", _flip(st.just(0x40))),
    "transfer id": _change("transfer id", _flip(st.integers(1, 31))),
    "corrupt": _change("corrupt", _corrupt),
    "shorten": _change("shorten", _shorten),
    "pause": _pause,
    "remote": _insert(st.builds(Frame, _ids, remote=st.just(True), dlc=st.one_of(st.none(), st.integers(0, 8)))),
    "standard id": _insert(st.builds(Frame, st.integers(0, 0x7FF), _small, extended=st.just(False))),
    "error frame": _insert(
        st.builds(Frame, st.integers(0, 0x3FF), st.binary(min_size=8, max_size=8), error=st.just(True))
    ),
    "drop count": _insert(st.integers(1, 99).map(lambda n: encode.drop_line("can0", n, n + 5).encode())),
    "garbage": _insert(st.one_of(st.sampled_from(_broken), _line)),
}
DIALECTS: dict[str, Callable[[Frame], str]] = {
    "log": encode.log_line,
    "log, ns": lambda f: encode.log_line(f, 9),
    "log, R": lambda f: encode.log_line(replace(f, direction="R")),
    "console": lambda f: encode.console_line(f, "a"),
    "console, -x": lambda f: encode.console_line(f, "a", extra=True),
}


@st.composite
def captures(draw: st.DrawFn, max_sessions: int = 5, max_damage: int = 4, dialects: tuple[str, ...] = ()) -> Capture:
    """A candump text of valid traffic with at most `max_damage` damages (0: none)."""
    sent = draw(traffic(max_sessions))
    rows = sorted((Row(f.t, f, one) for one in sent for f in one.frames), key=lambda row: row.t)
    names = draw(st.lists(st.sampled_from(sorted(DAMAGE)), max_size=max_damage))
    for name in names:
        if rows:
            DAMAGE[name](draw, rows, draw(st.integers(0, len(rows) - 1)))
    line = DIALECTS[draw(st.sampled_from(dialects or sorted(DIALECTS)))]
    end = draw(st.sampled_from([b"\n", b"\n", b"\r\n"]))
    texts = [line(replace(row.frame, t=row.t)).encode() if row.frame else row.text for row in rows]
    data = b"".join(text + end for text in texts)
    if rows and max_damage and draw(st.booleans()):
        names.append("truncate")
        data = data[: len(data) - draw(st.integers(1, len(texts[-1]) + len(end)))]
        _touch(rows[-1], "truncate")
    for number, row in enumerate(rows, 1):
        if row.owner:
            row.owner.lines.append(number)
    hurt = {one.session for one in sent if one.damage}
    for one in sent:
        one.calm = one.session not in hurt
    return Capture(data, sent, data.count(b"\n") + (not data.endswith(b"\n") and bool(data)), names)
