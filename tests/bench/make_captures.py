"""Make the sample captures: python tests/bench/make_captures.py [--check]

`cases()` is their ground truth, known from the senders alone: which transfers each file holds, with which fields, and
which are broken and how. The captures of kit/simulated.py come from `tailbyte simulate`, with a key to each. The files
in captures/ are committed; `--check` says whether they are still what this makes.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from kit import CAPTURES, encode, vendors
from kit.encode import Frame
from kit.flight import AUTOPILOT, ESCS, MS, SECOND, START, Row, Sender, Sent, hover, node_status, parameters
from kit.simulated import FLIGHTS, make_sample

FOLDER = CAPTURES


@dataclass(eq=False)
class Case:
    """One capture: its lines as rows, `rows[i]` is line i + 1; frame numbers count the frames alone, from 1."""

    name: str
    rows: list[Row]
    sent: list[Sent]  # every transfer, in the order of its first frame; its status is what must be shown
    unproven: tuple[Sent, ...] = ()  # of unknown types: sent, but their frames are foreign for want of a proof

    def __post_init__(self) -> None:
        number = 0
        for row in self.rows:
            number += row.frame is not None
            if row.frame and row.owner:
                row.owner.frames.append(number)
        self.sent.sort(key=lambda one: one.frames[0])

    @property
    def text(self) -> str:
        """The file: a row's own text (a console form, a line that is no frame) or its frame as `candump -l` has it."""
        return "".join((row.text or encode.log_line(row.frame)) + "\n" for row in self.rows)

    @property
    def frames(self) -> list[Frame]:
        return [row.frame for row in self.rows if row.frame]

    @property
    def verdicts(self) -> dict[int, str]:
        """Frame number -> verdict of the frames in no transfer; "" where more than one reading is sound."""
        framed = [row for row in self.rows if row.frame]
        return {number: row.verdict for number, row in enumerate(framed, 1) if not row.owner}

    @property
    def events(self) -> list[tuple[int, str]]:
        """(line, kind) of every line that is no frame."""
        return [(line, row.event) for line, row in enumerate(self.rows, 1) if row.event]


class Damage:
    """Takes transfers of a good capture apart."""

    def __init__(self, net: Sender) -> None:
        self.rows, self.sent = net.rows(), net.sent

    def pick(self, name: str, src: int, number: int, status: str, why: str) -> tuple[Sent, list[int]]:
        """The transfer `number` (from 0) of a type and node, marked, and where its frames stand in `rows`."""
        some = [one for one in self.sent if one.name == name and one.transfer.src == src]
        one = some[number]
        one.status, one.why = status, why
        return one, [at for at, row in enumerate(self.rows) if row.owner is one]

    def change(self, at: int, data: bytes) -> None:
        self.rows[at].frame = replace(self.rows[at].frame, data=data)

    def insert(self, ms: float, frame: Frame | None, **more: object) -> None:
        """A row at its place in time (before the first later frame)."""
        t = START + round(ms * MS)
        at = next((i for i, row in enumerate(self.rows) if row.frame and row.frame.t > t), len(self.rows))
        self.rows.insert(at, Row(frame and replace(frame, t=t), **more))

    def add(self, ms: float, sent: Sent, frames: list[Frame], gap: float = 0.2) -> None:
        """Frames of a transfer that the flight does not have."""
        self.sent.append(sent)
        for i, frame in enumerate(frames):
            self.insert(ms + i * gap, frame, owner=sent)


def faults() -> Case:
    """The flight of hover.log with one of everything that goes wrong."""
    job = Damage(hover())
    a, b, c, d = ESCS
    _, at = job.pick("ESCStatus", a, 10, "interrupted", "second of three frames lost")
    del job.rows[at[1]]
    _, at = job.pick("ESCStatus", b, 12, "bad crc", "one bit of the second frame wrong")
    data = bytearray(job.rows[at[1]].frame.data)
    data[2] ^= 0x10
    job.change(at[1], bytes(data))
    _, at = job.pick("ESCStatus", c, 14, "ok", "second frame recorded twice")
    job.rows.insert(at[1] + 1, Row(job.rows[at[1]].frame, verdict="duplicate"))
    _, at = job.pick("ESCStatus", d, 16, "interrupted", "toggle of the second frame wrong")
    data = job.rows[at[1]].frame.data
    job.change(at[1], data[:-1] + bytes([data[-1] ^ 0x20]))
    _, at = job.pick("ESCStatus", b, 20, "bad crc", "last frame filled up with zeros")
    data = job.rows[at[2]].frame.data
    job.change(at[2], data[:-1].ljust(7, b"\0") + data[-1:])
    again, at = job.pick("PUSHCAN", d, 5, "ok", "sent anew after an abort")
    aborted = Sent(again.transfer, again.name, again.fields, None, "interrupted", "given up after two of five frames")
    ms = (job.rows[at[0]].frame.t - START) / MS
    job.add(ms - 3, aborted, again.transfer.frames()[:2])
    stalled = encode.transfer("ParamGet", parameters(3), d, 1)
    late = Sent(stalled, "ParamGet", parameters(3), None, "timed out", "2.4 s between its fourth and fifth frame")
    job.add(1210, late, stalled.frames()[:4])
    for i, frame in enumerate(stalled.frames()[4:]):
        job.insert(3610 + i * 0.2, frame, verdict="orphan")
    job.insert(1100, encode.transfer("ParamGet", parameters(2), c, 5).frames()[3], verdict="orphan")
    job.insert(1300, Frame(stalled.can_id & ~0xFFFF00 | 1034 << 8), verdict="no tail")
    job.insert(1320, Frame(stalled.can_id, remote=True, dlc=8))
    for ms, counts in ((1400, "0008000000006000"), (1401, "0020000000008000")):  # warning, passive; counters
        error = Frame(0x204, bytes.fromhex(counts), START + ms * MS, error=True)
        job.insert(ms, None, text=encode.log_line(error), event="error frame")
    job.insert(1500, None, text=encode.drop_line("can0", 3, 3), event="drop")
    job.insert(1600, None, text="(1773475331.6003 can0 1F0406", event="unreadable")
    for k in range(20):
        job.insert(20 + 100 * k, Frame(0x123, bytes([k, 0, 0, 0, 0, 0, 0, 0x21]), extended=False), verdict="foreign")
    for k in range(40):  # J1939, engine speed: its last byte is always FF
        job.insert(
            25 + 50 * k, Frame(0x18F00417, bytes([0xF0, 0x7D, 0x7D, k, 0x13, 0xFF, 0xFF, 0xFF])), verdict="foreign"
        )
    for k in range(5):
        one = encode.Transfer("message", 20710, 30, bytes(range(k, k + 20)), 0x1122334455667788, k)
        job.add(300 + 100 * k, Sent(one, None, None, None, "unchecked", "unknown type, ids up by one"), one.frames())
    unproven = []
    for k, transfer_id in enumerate((4, 19)):
        one = encode.Transfer("message", 20777, 31, bytes([k] * 6), 0, transfer_id)
        unproven.append(Sent(one, None, None, None, "", "unknown type, no proof"))
        job.insert(700 + 300 * k, one.frames()[0], verdict="foreign")
    return Case("faults.log", job.rows, job.sent, tuple(unproven))


def empty_parameter() -> dict[str, dict]:
    return {name: {"empty": {}} for name in ("value", "default_value", "max_value", "min_value")}


def services() -> Case:
    """Calls, an allocation by an anonymous node, and standard types whose layout depends on their data."""
    net, tool, node = Sender(), 127, 42
    allocation = "uavcan.protocol.dynamic_node_id.Allocation"
    uid = list(range(0xD0, 0xE0))
    for k, (start, end) in enumerate(((0, 6), (6, 12), (12, 16))):
        ask = {"node_id": node, "first_part_of_unique_id": int(k == 0), "unique_id": uid[start:end]}
        net.put(k * 20, Sent(encode.transfer(allocation, ask, 0, k, kind="anonymous"), allocation, ask))
        told = {"node_id": node if end == 16 else 0, "first_part_of_unique_id": 0, "unique_id": uid[:end]}
        net.send(k * 20 + 6, allocation, AUTOPILOT, told)
    net.send(100, "uavcan.protocol.NodeStatus", node, node_status(0, 1))
    call, get_set = "uavcan.protocol.", "uavcan.protocol.param.GetSet"
    info = {
        "status": node_status(0, 1),
        "software_version": {
            "major": 4,
            "minor": 6,
            "optional_field_flags": 3,
            "vcs_commit": 0xC0FFEE,
            "image_crc": 2**63,
        },
        "hardware_version": {"major": 2, "minor": 1, "unique_id": uid, "certificate_of_authenticity": [1, 2, 3]},
        "name": list(b"org.example.gnss"),
    }
    real, text = {"real_value": 0.5}, {"string_value": list(b"north-east-down")}
    answers = [
        (
            "RATE",
            {"integer_value": -5},
            {"default_value": {"integer_value": 10}, "max_value": {"integer_value": 2**40}},
        ),
        ("GAIN", real, {"default_value": real, "min_value": {"real_value": -1.5}}),
        ("ARMED", {"boolean_value": 1}, {}),
        ("FRAME", text, {"default_value": {"string_value": []}}),
        ("", {"empty": {}}, {}),
    ]
    pairs = [(call + "GetNodeInfo", {}, info)]
    for index, (name, value, rest) in enumerate(answers):
        ask = {"index": index, "value": value if name == "GAIN" else {"empty": {}}, "name": list(name.encode())}
        pairs.append((get_set, ask, empty_parameter() | {"value": value, "name": list(name.encode())} | rest))
    pairs += [
        (
            call + "file.Read",
            {"offset": 0, "path": {"path": list(b"/fw.bin")}},
            {"error": {"value": 0}, "data": list(range(256))},
        ),
        (call + "file.Read", {"offset": 2**39, "path": {"path": list(b"/none")}}, {"error": {"value": 2}, "data": []}),
    ]
    for k, (name, ask, answer) in enumerate(pairs):
        asked = net.send(150 + 30 * k, name + ".Request", tool, ask, dst=node, priority=30)
        again = {"dst": tool, "priority": 30, "transfer_id": asked.transfer.transfer_id}
        net.send(158 + 30 * k, name + ".Response", node, answer, **again)
    log = {"level": {"value": 2}, "source": list(b"gnss"), "text": list("antenna: 3 \u00b5V".encode())}
    net.send(500, call + "debug.LogMessage", node, log)
    net.send(505, call + "debug.LogMessage", node, {"level": {"value": 0}, "source": [], "text": []})
    fix = {
        "timestamp": {"usec": 1_773_475_330_500_000},
        "gnss_timestamp": {"usec": 1_773_475_348_500_000},
        "gnss_time_standard": 3,
        "num_leap_seconds": 18,
        "longitude_deg_1e8": -1_223_456_789,
        "latitude_deg_1e8": 4_712_345_678,
        "height_ellipsoid_mm": 512_345,
        "height_msl_mm": -12_345,
        "ned_velocity": [0.5, -1.25, 0.0],
        "sats_used": 17,
        "status": 3,
        "mode": 2,
        "sub_mode": 1,
        "covariance": [0.25] * 3 + [0.0625] * 3,
        "pdop": 1.5,
        "ecef_position_velocity": [],
    }
    ecef = {"velocity_xyz": [1.0, 2.0, -3.0], "position_xyz_mm": [-(2**35), 0, 2**35 - 1], "covariance": [1.5, 2.5]}
    net.send(520, "uavcan.equipment.gnss.Fix2", node, fix)
    net.send(560, "uavcan.equipment.gnss.Fix2", node, fix | {"ecef_position_velocity": [ecef], "covariance": []})
    lights = [{"light_id": i, "color": {"red": 31 - i, "green": 63, "blue": i}} for i in range(3)]
    net.send(600, "uavcan.equipment.indication.LightsCommand", AUTOPILOT, {"commands": lights[:1]}, priority=20)
    net.send(610, "uavcan.equipment.indication.LightsCommand", AUTOPILOT, {"commands": lights}, priority=20)
    net.send(620, "uavcan.equipment.safety.ArmingStatus", AUTOPILOT, {"status": 255}, priority=16)
    return Case("services.log", net.rows(), net.sent)


def dialects() -> Case:
    """One line in each way that candump writes a frame, a NodeStatus of node 10 a line; then frames that are foreign.

    The `t` of a frame is 0 where its line states no absolute UTC time.
    """
    net = Sender()
    rows: list[Row] = []

    def line(form: str, **more: object) -> None:
        number = len(net.sent)
        t = START + number * SECOND + 123_456_789 * (form == "ns") + 123_456_000 * (form != "ns")
        sent = net.send(number, "uavcan.protocol.NodeStatus", 10, node_status(0, 100 + number))
        frame = replace(sent.transfer.frames(t)[0], **more)
        writers = {
            "log": encode.log_line(frame),
            "ns": encode.log_line(frame, 9),
            "cr": encode.log_line(frame) + "\r",
            "lower": encode.log_line(frame).replace(frame.data.hex().upper(), frame.data.hex()),
            "plain": encode.console_line(frame),
            "tight": encode.console_line(frame)[2:].replace("  ", " ").replace("  ", " "),
            "Normal": "Normal" + encode.console_line(frame, "z", START),
            "ascii": encode.console_line(frame, "a", text=True),
        }
        stamp, _, extra = form.partition("x")
        text = writers.get(form) or encode.console_line(frame, stamp, START, extra=bool(extra))
        dated = form in ("log", "ns", "cr", "lower", "ascii") or stamp == "a"
        rows.append(Row(frame if dated else replace(frame, t=0), sent, text=text))

    for form in ("log", "ns", "cr", "lower"):
        line(form)
    for direction in ("R", "T"):
        line("log", direction=direction)
        line("ax-x", direction=direction)
    for bus in ("vcan-0", "can.1", "slcan_long_name0"):
        line("log", bus=bus)
        line("a", bus=bus)
    for form in ("plain", "tight", "a", "d", "z", "A", "Ax-x", "ascii", "Normal"):
        line(form)
    for flags in (0, 1, 2, 4, 5, 7):
        line("log", fd=True, flags=flags)
    line("plain", fd=True)
    line("ax-x", fd=True, flags=1)
    t = START + 60 * SECOND
    raw = Frame(0x123, bytes(8), t, dlc=14, extended=False)
    standard = Frame(0x123, b"\x11\x22", t, extended=False)
    remote, sized = Frame(0x123, b"", t, remote=True, extended=False), Frame(0x1F040A05, b"", t, remote=True, dlc=8)
    rows += [
        Row(f, verdict="" if f.remote else "foreign") for f in (raw, standard, remote, sized, replace(sized, dlc=15))
    ]
    rows += [
        Row(replace(standard, t=0), verdict="foreign", text=encode.console_line(standard)),
        Row(remote, text=encode.console_line(remote, "a")),
        Row(
            replace(standard, bus="can1", fd=True),
            verdict="foreign",
            text=f"({encode.seconds(t)}) can1       123  [02]  11 22",
        ),
    ]
    error = Frame(4, bytes.fromhex("0004000000000000"), t, error=True)
    for text in (encode.log_line(error), encode.console_line(error), encode.console_line(error, "z", START)):
        rows.append(Row(None, text=text, event="error frame"))
    rows += [Row(None, text=encode.drop_line("can0", n, 4), event="drop") for n in (1, 3)]
    rows.append(Row(None, text="# a comment", event="comment"))
    return Case("dialects.txt", rows, net.sent)


def cases() -> dict[str, Case]:
    """Every capture by file name."""
    good, fd, hot = hover(), hover(250, fd=True), vendors.flight()
    made = (
        Case("hover.log", good.rows(), good.sent),
        faults(),
        dialects(),
        Case("fd.log", fd.rows(), fd.sent),
        services(),
        Case("hobbywing.log", hot.rows(), hot.sent),
    )
    return {case.name: case for case in made}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; fail where a file differs")
    check, wrong = parser.parse_args().check, 0
    for name, case in cases().items():
        path, text = FOLDER / name, case.text.encode()
        if check and not (path.exists() and path.read_bytes() == text):
            sys.stderr.write(f"{path} is not what make_captures.py makes\n")
            wrong = 1
        elif not check:
            path.write_bytes(text)
    with tempfile.TemporaryDirectory() as folder:
        for name in FLIGHTS:
            make_sample(name, Path(folder))
        for made in sorted(Path(folder).iterdir()):
            path = FOLDER / made.name
            if check and not (path.exists() and path.read_bytes() == made.read_bytes()):
                sys.stderr.write(f"{path} is not what `tailbyte simulate` makes\n")
                wrong = 1
            elif not check:
                shutil.copyfile(made, path)
    return wrong


if __name__ == "__main__":
    sys.exit(main())
