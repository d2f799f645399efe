"""The details of one row as lines, each with the bits that it speaks of and the field that it names."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

from analyzer.tables import EVENTS, EXTENDED, FD, REMOTE, VERDICTS
from analyzer.views.details.hexdump import tail_words
from analyzer.views.terminal import escape

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.views.frames.window import RawFrame

_STEP = 4  # blanks of a level
# Where a value lies, as the tree writes it: bytes from 1, bits 7 to 0.
_WHERE = re.compile(
    r"  (?:bytes (?P<first>\d+)-(?P<last>\d+)"
    r"|byte (?P<from>\d+) bit (?P<high>\d) to byte (?P<to>\d+) bit (?P<low>\d)"
    r"|byte (?P<byte>\d+)(?: bits? (?P<upper>\d)(?:-(?P<lower>\d))?)?)(?=  |$)"
)
_PICTURE = re.compile(r"^([01.](?:[01. ]*[01.])?) = (.*)$")
_LABEL = re.compile(r"^\[?([A-Za-z_]\w*(?:\[\d+\])?)(?: \((\w+)\))?(?:: (.*))?$")
_SOURCE = re.compile(r", from (\w+)\]")
_MESSAGE, _PACKET = re.compile(r"^Message (\S+)"), re.compile(r"^Packet (\S+)")


class DetailLine(NamedTuple):
    """A line of the details.

    `bits` are the first and the last bit of the payload that it speaks of, from 0, as they come on the bus; `inside`
    the single bits of such a range that a part of a word takes. `identifier` are bits of the CAN identifier likewise,
    from the first of 29. `part` names what else of a transfer it is about: crc or tail. `name` is the field as filters
    have it, `value` what it is.
    """

    depth: int
    text: str
    bits: tuple[int, int] | None = None
    inside: tuple[int, ...] = ()
    identifier: tuple[int, int] | None = None
    part: str = ""
    name: str = ""
    value: str = ""


def detail_lines(text: str) -> list[DetailLine]:
    """Return the lines of a tree as `-V` writes it."""
    found: list[DetailLine] = []
    names: list[str] = []
    parents: list[DetailLine] = []
    message = ""
    for raw in text.splitlines():
        said = raw.lstrip(" ")
        picture = _PICTURE.match(said)
        # Pictures of bits stand behind the blanks of their level; those of an identifier begin with odd ones.
        depth = (len(raw) - len(said)) // _STEP
        del parents[depth:], names[depth:]
        while len(names) < depth:
            names.append("")
        above = parents[-1] if parents else None
        line = _parsed(depth, said, picture, above, names, message)
        if line.bits is None and (source := _SOURCE.search(said)):
            line = line._replace(bits=_bits_of(found, source[1]))
        if head := _MESSAGE.match(said):
            message = head[1]
            line = line._replace(name=message)
        elif head := _PACKET.match(said):
            names.append(head[1])
            line = line._replace(name=f"{message}.{head[1]}", bits=_from_byte(said))
        elif line.name and not said.startswith("["):
            names.append(line.name.rpartition(".")[2])
        while len(names) <= depth:
            names.append("")
        while len(parents) < depth and above is not None:
            parents.append(above)
        parents.append(line)
        found.append(line)
    return found


def _parsed(
    depth: int, said: str, picture: re.Match[str] | None, above: DetailLine | None, names: Sequence[str], message: str
) -> DetailLine:  # fmt: skip
    line = DetailLine(depth, said)
    if picture is not None:
        return _pictured(line, picture, above)
    if fixed := _of_transfer(line, said):
        return fixed
    where = _WHERE.search(said)
    label = _LABEL.match(said if where is None else said[: where.start()].rstrip())
    line = line._replace(bits=None if where is None else _range(where))
    if label is None or not message:
        return line
    path = ".".join(filter(None, (message, *[one for one in names[2:depth] if one], label[1])))
    value = (label[3] or "").removesuffix("]").split(", from ")[0]
    return line._replace(name=path, value=re.sub(r"  +clause .*$", "", value).strip())


def _pictured(line: DetailLine, picture: re.Match[str], above: DetailLine | None) -> DetailLine:
    """Return a line with a picture of bits: a part of the identifier, or of the word above it."""
    label, _, value = picture[2].partition(": ")
    digits = picture[1].replace(" ", "")
    mask = [k for k, one in enumerate(digits) if one != "."]
    if above is None:
        return line
    if above.text.startswith("Identifier"):
        name, value = _of_identifier(label, value)
        return line._replace(identifier=(mask[0], mask[-1]), name=name, value=value)
    inside = () if above.bits is None else _bits_of_word(above.bits, len(digits), mask)
    return line._replace(
        bits=above.bits, inside=inside, name=f"{above.name}.{label}" if above.name else "", value=value
    )


def _of_transfer(line: DetailLine, said: str) -> DetailLine | None:
    """Return a line about the transfer itself, None for others."""
    value = said.partition(": ")[2]
    if not line.depth and (head := re.match(r"([A-Z]\w*) on ", said)):
        return line._replace(name=head[1])
    if said.startswith("Identifier"):
        return line._replace(identifier=(0, 28), name="can.id", value=f"0x{said.split(' ')[1]}")
    for begin, changes in (
        ("CRC: ", {"part": "crc"}), ("transfer ID", {"part": "tail"}),
        ("Transfer: ", {"name": "dronecan.status", "value": value}),
        ("since first frame: ", {"name": "frame.time_relative", "value": value.split(" ", maxsplit=1)[0]}),
        ("time: ", {"name": "frame.time", "value": f'"{value.removesuffix(" (local)")}"'}),
        ("Payload, not decoded: ", {"name": "payload", "value": value.replace(" ", ":")}),
        ("findings: ", {"name": "finding.rule", "value": f'"{value.split(",", maxsplit=1)[0]}"'}),
    ):  # fmt: skip
        if said.startswith(begin):
            return DetailLine(line.depth, line.text, **changes)  # type: ignore[arg-type]
    return None


def _of_identifier(label: str, value: str) -> tuple[str, str]:
    """Return name and value of a part of an identifier."""
    number = value.split(" ", maxsplit=1)[0]
    if label in ("message type", "service type"):
        called = re.search(r"\(([A-Za-z]\w*)\)", value)
        return (called[1], "") if called else ("dronecan.type_id", number)
    known = {
        "priority": "dronecan.priority", "source node": "dronecan.src", "destination node": "dronecan.dst",
        "direction": "dronecan.kind",
    }  # fmt: skip
    return known.get(label, ""), number


def _range(where: re.Match[str]) -> tuple[int, int]:
    """Return the first and the last bit, from 0, in the order of the bus: bit 7 of a byte comes first."""
    group = where.groupdict()
    if group["first"]:
        return (int(group["first"]) - 1) * 8, int(group["last"]) * 8 - 1
    if group["from"]:
        start = (int(group["from"]) - 1) * 8 + 7 - int(group["high"])
        return start, (int(group["to"]) - 1) * 8 + 7 - int(group["low"])
    base = (int(group["byte"]) - 1) * 8
    if group["upper"] is None:
        return base, base + 7
    lower = group["upper"] if group["lower"] is None else group["lower"]
    return base + 7 - int(group["upper"]), base + 7 - int(lower)


def _bits_of(lines: Sequence[DetailLine], field: str) -> tuple[int, int] | None:
    """Return the bits of the last line about a field."""
    return next((one.bits for one in reversed(lines) if one.name.endswith(f".{field}") and one.bits), None)


def _from_byte(said: str) -> tuple[int, int] | None:
    found = re.search(r"from byte (\d+)", said)
    return None if found is None else ((int(found[1]) - 1) * 8, (int(found[1]) - 1) * 8 + 7)


def _bits_of_word(bits: tuple[int, int], width: int, mask: Sequence[int]) -> tuple[int, ...]:
    """Return where bits of a word lie that is written with its highest bit first, and sent with its lowest byte."""
    first, last = bits
    if last - first + 1 != width:
        return ()
    found = []
    for shown in mask:
        bit = width - 1 - shown
        byte, within = divmod(bit, 8)
        size = min(8, width - byte * 8)
        found.append(first + byte * 8 + size - 1 - within)
    return tuple(sorted(found))


def with_transfer_id(lines: list[DetailLine], number: int) -> list[DetailLine]:
    """Return the details of a transfer with its ID, which `-V` leaves to the list."""
    at = next((k for k, line in enumerate(lines) if line.name == "dronecan.status"), len(lines) - 1)
    while at + 1 < len(lines) and lines[at + 1].depth > 1:
        at += 1
    line = DetailLine(2, f"transfer ID: {number}", part="tail", name="dronecan.transfer_id", value=str(number))
    return [*lines[: at + 1], line, *lines[at + 1 :]]


def frame_lines(number: int, frame: RawFrame, bus: str, verdict: int, time: str, rules: str) -> list[DetailLine]:
    """Return the details of a frame that forms no transfer."""
    return list(_frame_lines(number, frame, bus, verdict, time, rules))


def _frame_lines(number: int, frame: RawFrame, bus: str, verdict: int, time: str, rules: str) -> Iterator[DetailLine]:
    yield DetailLine(0, f"Frame {number} on {escape(bus)}: {VERDICTS[verdict]}", name="frame.number", value=str(number))
    yield DetailLine(1, f"time: {time}" if time else "time: not recorded")
    shown = f"Identifier {frame.id_text}"
    yield DetailLine(1, shown, identifier=(0, 28), name="can.id", value=f"0x{frame.id:X}")
    if frame.flags & EXTENDED:
        for label, high, low, name in (
            ("priority", 28, 24, "dronecan.priority"), ("type", 23, 8, ""), ("service", 7, 7, ""),
            ("source node", 6, 0, "dronecan.src"),
        ):  # fmt: skip
            value = frame.id >> low & (1 << high - low + 1) - 1
            span = 28 - high, 28 - low
            yield DetailLine(2, f"{label}: {value}", identifier=span, name=name, value=str(value))
    kind = "remote frame" if frame.flags & REMOTE else "CAN FD" if frame.flags & FD else "CAN"
    yield DetailLine(1, f"{kind}, {len(frame.data)} bytes", name="can.len", value=str(len(frame.data)))
    if frame.data and not frame.flags & REMOTE:
        yield DetailLine(
            2, f"data: {frame.data.hex(' ').upper()}", bits=(0, len(frame.data) * 8 - 1), name="frame.data",
            value=frame.data.hex(":").upper(),
        )  # fmt: skip
        yield DetailLine(2, f"as a tail byte: {tail_words(frame.data[-1])}", part="tail")
    if rules:
        first = rules.split(",", maxsplit=1)[0]
        yield DetailLine(1, f"findings: {rules}", name="finding.rule", value=f'"{first}"')


def event_lines(row: dict[str, object], time: str, text: str) -> list[DetailLine]:
    """Return the details of an error frame or a loss: `row` of the events, `text` as the list has it."""
    kind = EVENTS[int(str(row["kind"]))]
    found = [DetailLine(0, f"{kind}: {escape(text)}"), DetailLine(1, f"time: {time}" if time else "time: not recorded")]
    found.append(DetailLine(1, f"line or record {row['line']} of the capture"))
    for name in ("class", "tx_errors", "rx_errors"):
        if row[name] is not None:
            shown = f"0x{int(str(row[name])):X}" if name == "class" else str(row[name])
            found.append(DetailLine(2, f"{name.replace('_', ' ')}: {shown}"))
    if row["text"]:
        found.append(DetailLine(1, escape(str(row["text"]))))
    return found
