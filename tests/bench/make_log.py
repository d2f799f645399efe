"""Write the benchmark log: a TM-UAVCAN flight of any length as `candump -l` text. Same arguments, same bytes.

    python tests/bench/make_log.py --frames 10000000 --out flight.log [--esc-rate 50]

Node 10 commands 8 channels at 400 Hz; nodes 21..28 are ESCs: ESCStatus at --esc-rate, MotorStatus packets in PUSHCAN
at 10 Hz, ParamGet with 32 reserved bytes every 2 s; all nine send NodeStatus at 1 Hz. Priority 31, one 1 Mbit/s bus,
arbitrated by id. 50 Hz is 2850 frames/s, above the document's own limit of 2400; 30 Hz stays below it.

One period of 64 s, in which every transfer id wraps a whole number of times, is encoded by the test sender. Later
periods are the same text with new time stamps and with their counters (sequence, frame count, seconds) moved on.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from kit import encode

PERIOD = 64  # s
START = 1_700_000_000  # s
SECOND = 10**9
AUTOPILOT, ESCS = 10, range(21, 29)
DATA_AT = len("(1700000000.000000) can0 1F040A15#")
CRC_TABLE = np.array([encode.crc16(bytes([i]), 0) for i in range(256)], np.uint16)
HEX = np.frombuffer(b"0123456789ABCDEF", np.uint8)


@dataclass(eq=False)
class Job:
    """One transfer of the period: its type, its place in the text (a line a frame)."""

    name: str
    sent: encode.Transfer
    lines: list[int]


def throttle(channel: int, t: float) -> float:
    """0..1, periodic in 64 s."""
    turn = 2 * math.pi * t / PERIOD
    return 0.45 + 0.12 * math.sin(turn * 3 + channel) + 0.05 * math.sin(turn * (11 + channel))


def status(index: int, t: float, noise: random.Random) -> dict:
    part = throttle(index, t)
    return {
        "error_count": 4 << 12 | noise.randrange(16384) << 16,
        "voltage": 50.4 - 3 * part + noise.uniform(-0.1, 0.1),
        "current": 38 * part + noise.uniform(-0.5, 0.5),
        "temperature": 40 + 20 * part + noise.uniform(-0.2, 0.2),
        "rpm": int(6200 * part) + noise.randrange(-20, 20),
        "power_rating_pct": int(100 * part),
        "esc_index": index,
    }


def motor_status(index: int, number: int, t: float, noise: random.Random) -> dict:
    part = throttle(index, t)
    values = {
        "position": noise.randrange(36000),
        "pwm": 10400 + int(9000 * part),
        "throttle": int(250 * part),
        "speed": int(6200 * part),
        "voltage": 5040 - int(300 * part),
        "current": int(3800 * part),
        "temperature": 4000 + int(2000 * part),
        "power_on_count": 17 + index,
        "runtime": int(t),
    }
    return {
        "data_sequence": number,
        "data": list(encode.packet("PUSHCAN.MotorStatus", number, 0xA1 + index, **values)),
    }


def parameters(index: int, t: float, noise: random.Random) -> dict:
    return {
        "esc_index": index,
        "esc_uuid": 0xC0FFEE00 + index,
        "esc_id_req": index,
        "esc_ov_threshold": 630,
        "esc_oc_threshold": 120,
        "esc_ot_threshold": 110,
        "esc_acc_threshold": 4000,
        "esc_dacc_threshold": 4000,
        "esc_rotate_dir": index % 2,
        "esc_timing": 15,
        "esc_startup_times": 17 + index,
        "esc_startup_duration": 86400 + int(t),
        "esc_product_date": 20240703,
        "esc_error_count": 0,
        "esc_signal_priority": 1,
        "esc_led_mode": 407,
        "esc_can_rate": 0,
        "esc_fdb_rate": 50,
        "esc_save_option": 1,
        "rsvd": [noise.randrange(256) for _ in range(32)],
    }


def node_status(t: float) -> dict:
    return {"uptime_sec": int(t), "health": 0, "mode": 0, "sub_mode": 0, "vendor_specific_status_code": 0}


def period(esc_rate: int) -> tuple[list[encode.Frame], list[Job]]:
    """All frames of one period in bus order, times from 0, and the transfers that they belong to."""
    noise, bus, jobs = random.Random(1), encode.Bus(), []

    def every(hertz: float, name: str, node: int, make) -> None:
        phase = noise.uniform(0.05, 0.9) / hertz
        for number in range(round(PERIOD * hertz)):
            t = number / hertz + phase
            job = Job(name, encode.transfer(name, make(number, t), node, number), [])
            jobs.append(job)
            bus.send(int(t * SECOND) + noise.randrange(60_000), job.sent.frames(), job)

    every(400, "RawCommand", AUTOPILOT, lambda _, t: {"cmd": [int(8191 * throttle(c, t)) for c in range(8)]})
    for node in (AUTOPILOT, *ESCS):
        every(1, "uavcan.protocol.NodeStatus", node, lambda _, t: node_status(t))
    for index, node in enumerate(ESCS):
        every(esc_rate, "ESCStatus", node, lambda _, t, i=index: status(i, t, noise))
        every(10, "PUSHCAN", node, lambda n, t, i=index: motor_status(i, n, t, noise))
        every(0.5, "ParamGet", node, lambda _, t, i=index: parameters(i, t, noise))
    frames = []
    for line, (frame, job) in enumerate(bus.run()):
        job.lines.append(line)
        frames.append(frame)
    if frames[-1].t >= PERIOD * SECOND + frames[0].t:
        raise ValueError("the bus is too full: the period does not end in time")
    return frames, jobs


class Text:
    """The text of one period, whose counters and stamps can be moved on."""

    def __init__(self, frames: list[encode.Frame], jobs: list[Job]) -> None:
        lines = [encode.log_line(frame).encode() + b"\n" for frame in frames]
        self.bytes = np.frombuffer(b"".join(lines), np.uint8).copy()
        self.ends = np.cumsum([len(line) for line in lines])
        starts = self.ends - np.array([len(line) for line in lines])
        self.seconds = np.array([frame.t // SECOND for frame in frames])
        self.digits = starts[:, None] + 1 + np.arange(10)
        self.groups = []
        for name in ("PUSHCAN", "ParamGet", "uavcan.protocol.NodeStatus"):
            some = [job for job in jobs if job.name == name]
            payload = np.frombuffer(b"".join(job.sent.payload for job in some), np.uint8).reshape(len(some), -1)
            head = 0 if some[0].sent.crc is None else 2
            at = np.arange(payload.shape[1] + head)
            line_of = starts[np.array([job.lines for job in some])][:, at // 7]
            self.groups.append((name, payload, head, line_of + DATA_AT + 2 * (at % 7)))

    def move(self, turn: int) -> None:
        """Rewrite stamps and counters for the period number `turn`."""
        names = [f"{START + turn * PERIOD + s:010}".encode() for s in range(self.seconds.max() + 1)]
        self.bytes[self.digits] = np.frombuffer(b"".join(names), np.uint8).reshape(-1, 10)[self.seconds]
        for name, base, head, at in self.groups:
            whole = advance(name, base, turn)
            if head:
                whole = np.hstack([transfer_crc(name, whole), whole])
            self.bytes[at], self.bytes[at + 1] = HEX[whole >> 4], HEX[whole & 15]


def advance(name: str, payload: np.ndarray, turn: int) -> np.ndarray:
    """The payloads with their counters moved on by `turn` periods."""
    out = payload.copy()

    def add(start: int, size: int, amount: int) -> None:
        number = np.ascontiguousarray(out[:, start : start + size]).view(f"<u{size}")
        out[:, start : start + size] = (number + np.array(amount % 256**size, number.dtype)).view(np.uint8)

    if name == "PUSHCAN":
        add(0, 4, 10 * PERIOD * turn)  # data sequence
        add(4 + 3, 1, 10 * PERIOD * turn)  # frame count
        add(4 + 25, 2, PERIOD * turn)  # runtime
        out[:, -1] = out[:, 4:-1].sum(axis=1) & 0xFF
    else:
        add(22 if name == "ParamGet" else 0, 4, PERIOD * turn)
    return out


def transfer_crc(name: str, payload: np.ndarray) -> np.ndarray:
    crc = np.full(len(payload), encode.signature_crc(encode.TYPES[name].signature), np.uint16)
    for column in payload.T:
        crc = (crc << np.uint16(8)) ^ CRC_TABLE[(crc >> np.uint16(8)) ^ column]
    return np.stack([crc & np.uint16(255), crc >> np.uint16(8)], axis=1).astype(np.uint8)


def write(path: Path, frames: int, esc_rate: int = 50) -> None:
    """Write a log of exactly `frames` lines."""
    text, turn = Text(*period(esc_rate)), 0
    with path.open("wb") as out:
        while frames > 0:
            text.move(turn)
            take = min(frames, len(text.ends))
            out.write(text.bytes[: text.ends[take - 1]].data)
            frames, turn = frames - take, turn + 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=10_000_000)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--esc-rate", type=int, default=50, metavar="HZ")
    options = parser.parse_args()
    write(options.out, options.frames, options.esc_rate)


if __name__ == "__main__":
    main()
