"""Vendors beside T-Motor: a maker of pumps, made up for the tests, and Hobbywing with a flight made by hand.

The pumps have a type of their own, with a profile, and a capture of it. Four Hobbywing ESCs and a flight controller
power up and hover, and one of them gets too hot; their types stand in `hobbywing.txt`, as `kit.encode` takes them.
"""

from __future__ import annotations

import struct
from operator import itemgetter
from typing import Any

from kit import encode
from kit.flight import AUTOPILOT, ESCS, Sender, node_status, throttle

ACME = 20777
PROFILE = """\
name = "Acme"
version = "1"
tree = "."

[enum.State]
0 = "idle"
2 = "spinning"

[message.Pump]
type = "acme.pump.Pump"
clause = "7"

[message.Pump.field.state]
enum = "State"

[message.Pump.field.pressure]
unit = "bar"
scale = 0.01
"""
PUMP = "uint3 state\nvoid5\nuint16 pressure\nfloat16 temperature\nPart[<=4] parts\n"
PART = "uint8 number\nint16 value\n"


def capture(signature: int) -> bytes:
    """Three transfers of the new type between those of an old one."""
    out = []
    for k in range(3):
        body = struct.pack("<BHe", 2 << 5, 150 + k, 21.5) + b"".join(struct.pack("<Bh", n, -n * k) for n in range(3))
        one = encode.Transfer("message", ACME, 42, body, signature, k)
        t = (1_700_000_000 + k) * 10**9
        out += one.frames(t)
        out += encode.transfer("RawCommand", {"cmd": [k] * 4}, 1, k).frames(t + 10**6)
    return "".join(encode.log_line(frame) + "\n" for frame in out).encode()


SPACE = "com.hobbywing.esc."
HOT = ESCS[2]
ESC_LIMIT, MOTOR_LIMIT = 104, 149  # degC, the highest that Hobbywing calls safe
COUNTER_CLOCKWISE = 1 << 14
FULL, HALF, FIFTY_HZ, TEN_HZ = 8191, 4096, 5, 7


def heat(node: int, ms: float) -> int:
    """degC of an ESC: 40 and a little more; the hot one rises by 40 a second from 0.6 s on."""
    own = 40 + node % 4 + int(ms / 500)
    return own + max(0, int((ms - 600) / 25)) if node == HOT else own


def reports(node: int, ms: float) -> dict[str, dict[str, Any]]:
    """What an ESC says of itself; a hot one gives less."""
    index = ESCS.index(node)
    part = throttle(index, ms) * (0.6 if heat(node, ms) > ESC_LIMIT else 1)
    hot = heat(node, ms)
    return {
        "StatusMsg1": {"rpm": int(5200 * part), "pwm": int(1000 * part), "status": COUNTER_CLOCKWISE * (index % 2)},
        "StatusMsg2": {"input_voltage": 502 - int(30 * part), "current": int(360 * part) + 3, "temperature": hot},
        "StatusMsg3": {"MOS_T": hot + 2, "CAP_T": hot - 5, "Motor_T": 35 + int(ms / 200)},
    }


def flight(ms: int = 3000) -> Sender:
    """Commands at 50 Hz, reports at 20, 10 and 5 Hz. Nothing is wrong but the heat of one ESC, and its self-test."""
    net, plans = Sender(), []

    def plan(t: float, name: str, node: int, fields: dict[str, Any], **more: Any) -> None:
        plans.append((t, name, node, fields, more))

    def call(t: float, service: str, node: int, ask: dict[str, Any], answer: dict[str, Any]) -> None:
        plan(t, f"{SPACE}{service}.Request", AUTOPILOT, ask, dst=node)
        plan(t + 3, f"{SPACE}{service}.Response", node, answer, dst=AUTOPILOT, transfer_id=0)

    for k in range(ms // 20):
        plan(k * 20, f"{SPACE}RawCommand", AUTOPILOT, {"command": [int(FULL * throttle(c, k * 20)) for c in range(4)]})
    for k in range(ms // 1000):
        for at, node in enumerate((AUTOPILOT, *ESCS)):
            plan(k * 1000 + 40 + 7 * at, "uavcan.protocol.NodeStatus", node, node_status(k * 1000, 12))
            plan(k * 1000 + 90 + 2 * at, f"{SPACE}GetEscID", node, {"payload": [node, at] if at else [0]})
    for index, node in enumerate(ESCS):
        for name, period in (("StatusMsg1", 50), ("StatusMsg2", 100), ("StatusMsg3", 200)):
            for k in range(ms // period):
                t = k * period + 1.3 + 2.6 * index
                plan(t, SPACE + name, node, reports(node, t)[name])
        rate = {"option": 1, "MSG_ID": 20050, "rate": FIFTY_HZ}
        call(110 + 9 * index, "SetReportingFrequency", node, rate, rate)
        call(150 + 9 * index, "SelfTest", node, {}, {"status": int(node == HOT)})
        config = {
            "direction": index % 2, "throttle_source": 0, "throttle_channel": index + 1, "led_status": 1,
            "led_color": 4, "MSG2_rate": TEN_HZ, "MSG1_rate": FIFTY_HZ, "positioning_angle": 0, "reserved": [0, 0],
        }  # fmt: skip
        call(190 + 9 * index, "GetMajorConfig", node, {"option": 0}, config)
    for t, name, node, fields, more in sorted(plans, key=itemgetter(0)):
        net.send(t, name, node, fields, **more)
    return net


TENTHS = {"com.hobbywing.esc.StatusMsg2": ("input_voltage", "current")}  # fields that are sent in tenths of the unit


def physical(name: str, fields: dict[str, Any]) -> dict[str, Any]:
    """The fields of a type as its table shows them."""
    return {field: value / 10 if field in TENTHS.get(name, ()) else value for field, value in fields.items()}
