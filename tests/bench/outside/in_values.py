"""Values that the document rules out: one message or a few, in a flight that is as it should be."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bench.outside.flight import AUTOPILOT, DOWN, FIRST, GROUND, RISE, Message, encoded, push, settings
from bench.outside.kinds import Kinds
from bench.outside.sending import altered, case, esc, few, one_of, sent
from kit import encode
from kit.encode import Code

if TYPE_CHECKING:
    from collections.abc import Callable
    from random import Random

    from bench.outside.flight import Flight
    from bench.outside.kinds import Case

VALUES = Kinds()
kind = VALUES.kind
NAN, INFINITE = Code(0x7E00), Code(0x7C00)
# What an ESC is made out to be, when its index or its throttle changes (4.4.3, 4.4.1).
INDEXES = "BUS-009 BUS-025 BUS-026 BUS-027 TYP-103 PUSH-011"


def values(name: str, carrier: str, needs: str, also: str = "", **fields: Callable[[Random], Any]) -> None:
    """A kind: a few reports of one ESC have such fields."""

    @kind(name, needs, also)
    def make(flight: Flight, rng: Random) -> Case:
        node, new = esc(flight, rng), {key: value(rng) for key, value in fields.items()}
        chosen = few(flight, rng, lambda m: carrier in (m.name, m.packet) and m.src == node)
        return altered(flight, chosen, lambda m: m.but(**new), node, AUTOPILOT, about=f"node {node} {new}")


def word(rng: Random, keep: int, low: int, high: int, at: int) -> int:
    """A status word (4.4.3) with a part of it drawn."""
    return keep | rng.randrange(low, high) << at


# 4.4.3 table: no 1-4 and its bits, 5-12, 13, 14
values(
    "operating mode not in the table",
    "ESCStatus",
    "TYP-304",
    error_count=lambda r: r.choice([0, *range(9, 16)]) << 12 | 500 << 16,
)
values(
    "encoder above 16383", "ESCStatus", "TYP-303", "BUS-032", error_count=lambda r: word(r, 4 << 12, 16384, 65536, 16)
)
values("error mode", "ESCStatus", "TYP-306", "TYP-305 BUS-032", error_count=lambda r: 6 << 12 | r.randrange(9999) << 16)
for _bit, _name in enumerate(
    ("overvoltage", "under-voltage", "overcurrent", "throttle loss", "throttle abnormal", "MOS too hot",
     "capacitor too hot", "stall", "amplifier", "upper bridge", "lower bridge", "encoder")
):  # fmt: skip
    values(
        f"fault bit {_bit}, {_name}",
        "ESCStatus",
        "TYP-305",
        "BUS-032 BUS-007 BUS-016 BUS-017",
        error_count=lambda r, bit=_bit: 4 << 12 | 1 << bit | r.randrange(9999) << 16,
    )
values("voltage not a number", "ESCStatus", "TYP-007|TYP-308", "PUSH-409", voltage=lambda _: NAN)
values("current infinite", "ESCStatus", "TYP-008|TYP-308", "TYP-308 PUSH-409", current=lambda _: INFINITE)
values("voltage of no battery", "ESCStatus", "TYP-308", "PUSH-409", voltage=lambda r: r.choice([-30.0, 400.0, 2000.0]))
values(
    "temperature of no ESC", "ESCStatus", "TYP-308", "TYP-301 PUSH-409", temperature=lambda r: r.choice([-200.0, 900.0])
)
values("speed of no motor", "ESCStatus", "TYP-308", "PUSH-409", rpm=lambda r: r.choice([131_071, -120_000, 110_000]))
values("throttle above 100 %", "ESCStatus", "TYP-302", "PUSH-409", power_rating_pct=lambda r: r.randrange(101, 128))
values("index above 19", "ESCStatus", "TYP-201", INDEXES, esc_index=lambda r: r.randrange(20, 32))
# 4.4.5 table 1
MOTOR = "PUSHCAN.MotorStatus"
values("system status fault", MOTOR, "PUSH-401", "", system_status=lambda _: 0xCC)
values("system status unknown", MOTOR, "PUSH-401", "", system_status=lambda r: r.choice([1, 0x22, 0xCD, 0xFF]))
values(
    "position above 360 degrees", MOTOR, "PUSH-402", "BUS-032 PUSH-409", position=lambda r: r.randrange(36001, 65536)
)
values(
    "PWM width out of range", MOTOR, "PUSH-403", "BUS-034 PUSH-*", pwm=lambda r: r.choice([3000, 7000, 25000, 60000])
)
values("output throttle above 100 %", MOTOR, "PUSH-404", "PUSH-409", throttle=lambda r: r.randrange(251, 256))
values("motor fault flag", MOTOR, "PUSH-410", "", fault=lambda r: 1 << r.randrange(12))
values("packet voltage unlike ESCStatus", MOTOR, "PUSH-409", "", voltage=lambda r: r.choice([3000, 6000]))
values("packet speed unlike ESCStatus", MOTOR, "PUSH-409", "", speed=lambda r: r.choice([900, 4500]))
values("power-on count backward", MOTOR, "PUSH-407", "BUS-021 BUS-037", power_on_count=lambda r: r.randrange(1, 30))


def packets(name: str, needs: str, also: str, make: Callable[[bytearray, Random], bytes], **more: Any) -> None:
    """A kind: the bytes of one motor status packet are wrong (4.4.5 table 1)."""

    @kind(name, needs, also)
    def wrong(flight: Flight, rng: Random) -> Case:
        one = one_of(flight, rng, lambda m: m.packet == MOTOR)
        unit, count = more.get("unit", lambda _: one.unit)(rng), rng.randrange(256) if "unit" in more else None
        place = sum(m.src == one.src and bool(m.packet) and m.t < one.t for m in flight.messages)
        whole = bytearray(encode.packet(MOTOR, place if count is None else count, unit, **one.values))
        return altered(
            flight, [one], lambda m: sent(m, raw=bytes(make(whole, rng))), one.src, about=f"at {one.t:.0f} ms"
        )


def summed(whole: bytes) -> bytes:
    """The same with the checksum of what it is now."""
    return bytes(whole[:-1]) + bytes([sum(whole[:-1]) & 0xFF])


def at(place: int, *new: int) -> Callable[[bytearray, Random], bytes]:
    return lambda whole, rng: summed(bytes(whole[:place]) + bytes([rng.choice(new)]) + bytes(whole[place + 1 :]))


HOLE = "PUSH-009 PUSH-304 PUSH-004 PUSH-001"
packets("packet header unknown", "PUSH-001", HOLE, at(0, 0, 0x7C, 0xB7, 0xFF))
packets(
    "packet header of the other direction",
    "PUSH-002",
    "PUSH-009 PUSH-304 PUSH-007 PUSH-001",
    lambda w, _: summed(b"\xec\x96" + bytes(w[2:])),
)
packets("packet length wrong", "PUSH-003", "PUSH-004 PUSH-005 PUSH-009 PUSH-304", at(5, 0x1B, 0x1D, 7, 0xFF))
packets(
    "packet cut short",
    "PUSH-004",
    "PUSH-003 PUSH-005 PUSH-009 PUSH-304 PUSH-001",
    lambda w, r: bytes(w[: r.randrange(8, 27)]),
)
packets("packet followed by more", "PUSH-004", "PUSH-001 PUSH-003", lambda w, r: bytes(w) + bytes(r.randrange(1, 9)))
packets(
    "packet checksum wrong",
    "PUSH-005",
    "PUSH-009 PUSH-304",
    lambda w, r: bytes(w[:-1]) + bytes([w[-1] ^ r.randrange(1, 256)]),
)
packets(
    "packet byte corrupted",
    "PUSH-005",
    "PUSH-009 PUSH-304",
    lambda w, r: bytes(w[: (k := r.randrange(6, 26))]) + bytes([w[k] ^ r.randrange(1, 256)]) + bytes(w[k + 1 :]),
)
packets("packet frame ID unknown", "PUSH-007", "PUSH-009 PUSH-304", at(2, 0, 1, 0x77, 0xFE))
packets("power unit out of range", "PUSH-008", "PUSH-009 PUSH-011 PUSH-304", at(4, 0xA0, 0xAA, 0, 0xFF))


def configured(name: str, needs: str, **fields: Callable[[Random], int]) -> None:
    """Kinds: the ground station sets such a value (4.4.2), or an ESC reports it (4.4.6)."""
    also = "BUS-011 BUS-013 BUS-014 BUS-015 BUS-018 BUS-019 BUS-024 BUS-029 TYP-209 TYP-210"

    @kind(f"{name}, set", needs, also)
    def asked(flight: Flight, rng: Random) -> Case:
        new = {key: value(rng) for key, value in fields.items()}
        wrong = Message(1100, "ParamCfg", GROUND, settings(0, flight.rate) | new)
        answer = [m for m in flight.messages if (m.name, m.src) == ("ParamGet", FIRST)][-1]
        return case(flight, [*flight.messages, wrong, sent(answer, t=1104)], GROUND, FIRST, about=str(new))

    @kind(f"{name}, reported", needs, also + " BUS-012 BUS-025 TYP-103")
    def told(flight: Flight, rng: Random) -> Case:
        new = {key.replace("_set", "_req"): value(rng) for key, value in fields.items()}
        node = esc(flight, rng)
        chosen = [m for m in flight.messages if (m.name, m.src) == ("ParamGet", node)][:1]
        return altered(flight, chosen, lambda m: m.but(**new), node, GROUND, about=f"node {node} {new}")


configured("ESC ID above 19", "TYP-202", esc_id_set=lambda r: r.choice([20, 99, 1000]))
configured("timing not in 1 to 29", "TYP-203", esc_timing=lambda r: r.choice([0, 30, 99]))
configured("throttle priority not in the table", "TYP-204", esc_signal_priority=lambda r: r.choice([2, 9, 0x81]))
configured("bus rate not in the table", "TYP-205", esc_can_rate=lambda r: r.randrange(6, 255))
configured("report rate above 400", "TYP-206", esc_fdb_rate=lambda r: r.choice([401, 1000, 0x0101 * 100]))
configured("save option not in the table", "TYP-207", esc_save_option=lambda r: r.randrange(2, 255))


def foc(name: str, packet: str, needs: str, **fields: Callable[[Random], int]) -> None:
    """A kind: a parameter packet of a unit holds such a value (4.4.4 table 2, 4.4.5 table 2)."""

    @kind(name, needs, "PUSH-103 PUSH-102")
    def make(flight: Flight, rng: Random) -> Case:
        new = {key: value(rng) for key, value in fields.items()}
        fit = [m for m in flight.messages if m.packet == packet]
        one = rng.choice(fit)
        return altered(flight, [one], lambda m: m.but(**new), one.src, FIRST + one.unit - 0xA1, GROUND, about=str(new))


for _what, _values in {
    "bus rate": {"bus_rate": lambda r: r.randrange(6, 255)},
    "report rate": {"report_rate": lambda r: r.randrange(401, 65000)},
    "save option": {"save_option": lambda r: r.randrange(3, 255)},
}.items():
    foc(f"FOC {_what} out of range", "PUSHSCI.FocParameters", "PUSH-101", **_values)
    foc(f"FOC feedback {_what} out of range", "PUSHCAN.FocFeedback", "PUSH-502", **_values)
foc(
    "FOC priority out of range", "PUSHSCI.FocParameters", "PUSH-101", throttle_priority=lambda r: r.choice([2, 7, 0xFE])
)


def control(name: str, needs: str, **fields: Callable[[Random], int]) -> None:
    @kind(name, needs, "PUSH-304")
    def make(flight: Flight, rng: Random) -> Case:
        new = {key: value(rng) for key, value in fields.items()}
        chosen = [m for m in flight.messages if m.packet == "PUSHSCI.OutputControl"]
        return altered(flight, chosen, lambda m: m.but(**new), GROUND, about=str(new))


control("control mode not in the table", "PUSH-301", control_mode=lambda r: r.choice([1, 0x23, 0x99, 0xFF]))
control("control packet with reserved bytes", "PUSH-303", reserved=lambda r: r.randrange(1, 65536))


@kind("set point out of range", "PUSH-302", "PUSH-304 PUSH-305 PUSH-306 PUSH-307 PUSH-308")
def set_point(flight: Flight, rng: Random) -> Case:
    mode, least = rng.choice([(0x55, 10001), (0x33, 10001), (0x44, 10001), (0x11, 3601), (0x1A, 3601)])
    asked = push(1050, "PUSHSCI.OutputControl", GROUND, 0xA2, control_mode=mode, set_point=rng.randrange(least, 65536))
    return case(flight, [*flight.messages, asked], GROUND, FIRST + 1, about=f"mode {mode:02X}")


def payloads(name: str, carrier: str, needs: str, also: str, make: Callable[[bytes, Random], bytes]) -> None:
    """A kind: the payload of a few transfers is not laid out as 5.3 says."""

    @kind(name, needs, also)
    def wrong(flight: Flight, rng: Random) -> Case:
        src = AUTOPILOT if carrier == "RawCommand" else esc(flight, rng)
        chosen = few(flight, rng, lambda m: m.name == carrier and m.src == src)
        # (what is wrong is sent as it is, with the right CRC)
        new = {m: make(encoded(m), rng) for m in chosen}
        return altered(
            flight, chosen, lambda m: sent(m, payload=new[m]), src, about=f"node {src} at {chosen[0].t:.0f} ms"
        )


THROTTLE = "TYP-101 TYP-102 TYP-103 TYP-104 TYP-105 BUS-016 BUS-017 BUS-026 BUS-027 BUS-028"
payloads("ESCStatus too short", "ESCStatus", "TYP-001", INDEXES, lambda p, r: p[: r.randrange(3, 14)])
payloads("ESCStatus too long", "ESCStatus", "TYP-002", INDEXES, lambda p, r: p + bytes(r.randrange(1, 5)))
payloads(
    "padding of ESCStatus set", "ESCStatus", "TYP-003", "", lambda p, r: p[:-1] + bytes([p[-1] | r.randrange(1, 4)])
)
payloads(
    "RawCommand of no whole channels", "RawCommand", "TYP-004|TYP-001", THROTTLE, lambda p, r: p[: r.choice([1, 3, 5])]
)
payloads(
    "RawCommand of 21 channels and more",
    "RawCommand",
    "TYP-005|TYP-002",
    THROTTLE,
    lambda _, r: bytes((14 * r.randrange(21, 24) + 7) // 8),
)
payloads("RawCommand without channels", "RawCommand", "TYP-104", THROTTLE, lambda *_: b"")


@kind("negative throttle", "TYP-101", "TYP-102 BUS-016 BUS-017")
def negative(flight: Flight, rng: Random) -> Case:
    return commanded(flight, rng, rng.randrange(-8191, 0))


@kind("throttle of -8192", "TYP-102", "TYP-101 BUS-016 BUS-017")
def lowest(flight: Flight, rng: Random) -> Case:
    return commanded(flight, rng, -8192)


def commanded(flight: Flight, rng: Random, value: int) -> Case:
    channel = rng.randrange(flight.escs)
    chosen = few(flight, rng, lambda m: m.name == "RawCommand")

    def wrong(one: Message) -> Message:
        cmd = list(one.fields["cmd"])
        cmd[channel] = value
        return one.but(cmd=cmd)

    return altered(flight, chosen, wrong, AUTOPILOT, FIRST + channel, about=f"channel {channel} {value}")


@kind("padding of RawCommand set", "TYP-003", "")
def padding(flight: Flight, rng: Random) -> Case:
    if flight.escs * 14 % 8 == 0:
        raise LookupError("no padding")
    chosen = few(flight, rng, lambda m: m.name == "RawCommand")
    wrong = {
        m: encoded(m)[:-1] + bytes([encoded(m)[-1] | 1 << rng.randrange(8 - flight.escs * 14 % 8)]) for m in chosen
    }
    return altered(flight, chosen, lambda m: sent(m, payload=wrong[m]), AUTOPILOT, about=f"at {chosen[0].t:.0f} ms")


@kind("sequence number leaps", "TYP-501", "")
def leap(flight: Flight, rng: Random) -> Case:
    return sequence(flight, rng, lambda now, step: now + step)


@kind("sequence number stands still", "TYP-502", "TYP-503")
def still(flight: Flight, rng: Random) -> Case:
    return sequence(flight, rng, lambda *_: 3)


@kind("sequence number restarts", "TYP-503", "BUS-037")
def restart(flight: Flight, rng: Random) -> Case:
    return sequence(flight, rng, lambda now, _: now % 16 if now > 16 else now)


def sequence(flight: Flight, rng: Random, new: Callable[[int, int], int]) -> Case:
    """From a place on the sender of PUSHCAN counts otherwise (4.4.5 no 1-4)."""
    node, step = esc(flight, rng), rng.randrange(2, 900)
    mine = sorted((m for m in flight.messages if (m.name, m.src) == ("PUSHCAN", node)), key=lambda m: m.t)
    begin = rng.randrange(20, len(mine) - 20)
    numbers = {m: new(k, step) for k, m in enumerate(mine) if k >= begin}
    return altered(
        flight, list(numbers), lambda m: sent(m, sequence=numbers[m]), node, about=f"node {node} from {begin}"
    )


@kind("packet count leaps", "PUSH-009", "")
def count_leaps(flight: Flight, rng: Random) -> Case:
    node, step = esc(flight, rng), rng.randrange(2, 200)
    mine = sorted((m for m in flight.messages if (m.name, m.src) == ("PUSHCAN", node)), key=lambda m: m.t)
    begin = rng.randrange(20, len(mine) - 20)
    numbers = {m: k + step for k, m in enumerate(mine) if k >= begin}
    return altered(flight, list(numbers), lambda m: sent(m, count=numbers[m]), node, about=f"node {node} from {begin}")


@kind("packet count stands still", "PUSH-009", "")
def count_still(flight: Flight, rng: Random) -> Case:
    node = esc(flight, rng)
    chosen = [m for m in flight.messages if (m.name, m.src) == ("PUSHCAN", node) and RISE < m.t < DOWN]
    return altered(flight, chosen, lambda m: sent(m, count=30), node, about=f"node {node}")
