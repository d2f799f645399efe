"""An independent DroneCAN sender for tests: it shares no code and no tables with the analyzer.

Read upwards from `Transfer.frames`: fields become bits, bits a payload, a payload frames, frames lines of candump. The
layouts were written from the document by hand; test_encode.py compares them with golden vectors and pydronecan.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cache
from heapq import heappop, heappush
from pathlib import Path
from typing import Any

HEADERS = {"PUSHSCI": b"\xec\x96", "PUSHCAN": b"\x7b\x8c"}
DLC_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


class Code(int):
    """A float16 or float32 given as its raw code, for NaN payloads and infinities."""


# Layouts: u/i/f/v (void) and a width, [n] a fixed array, [<n] one of at most n, a capital a record of RECORDS.
_RECORDS = """
Status = uptime_sec:u32 health:u2 mode:u3 sub_mode:u3 vendor_specific_status_code:u16
Software = major:u8 minor:u8 optional_field_flags:u8 vcs_commit:u32 image_crc:u64
Hardware = major:u8 minor:u8 unique_id:u8[16] certificate_of_authenticity:u8[<255]
Empty =
Value = union empty:Empty integer_value:i64 real_value:f32 boolean_value:u8 string_value:u8[<128]
Number = union empty:Empty integer_value:i64 real_value:f32
Path = path:u8[<200]
Error = value:i16
Level = value:u3
Stamp = usec:u56
Ecef = velocity_xyz:f32[3] position_xyz_mm:i36[3] :v6 covariance:f16[<36]
Colour = red:u5 green:u6 blue:u5
Light = light_id:u8 color:Colour
"""
_ESC = "uuid:u32 {id}:u16 ov_threshold:u16 oc_threshold:u16 ot_threshold:u16 acc_threshold:u16 dacc_threshold:u16"
_ESC = f"esc_index:u8 {_ESC} rotate_dir:i16 timing:u8".replace(" ", " esc_").replace("esc_{", "{")
_REST = "esc_signal_priority:u8 esc_led_mode:u16 esc_can_rate:u8 esc_fdb_rate:u16 esc_save_option:u8"
# Types: name, kind, id, signature, layout. A message of id 0..3 can be sent anonymously too.
_TYPES = f"""
RawCommand message 1030 217F5C87D7EC951D cmd:i14[<20]
ParamCfg message 1033 948F5E0B33E0EDEE {_ESC.format(id="esc_id_set")} {_REST}
ESCStatus message 1034 A9AF28AEA2FBB254 error_count:u32 voltage:f16 current:f16 temperature:f16 rpm:i18
    power_rating_pct:u7 esc_index:u5
PUSHSCI message 1038 CE2B6D6B6BDC0AE8 data_sequence:u32 data:u8[<255]
PUSHCAN message 1039 AACF9B4B2577BC6E data_sequence:u32 data:u8[<255]
ParamGet message 1332 462875A0ED874302 {_ESC.format(id="esc_id_req")} esc_startup_times:u16
    esc_startup_duration:u32 esc_product_date:u32 esc_error_count:u32 {_REST} rsvd:u8[<32]
uavcan.protocol.NodeStatus message 341 0F0868D0C1A7C6F1 uptime_sec:u32 health:u2 mode:u3 sub_mode:u3
    vendor_specific_status_code:u16
uavcan.protocol.dynamic_node_id.Allocation message 1 0B2A812620A11D40 node_id:u7 first_part_of_unique_id:u1
    unique_id:u8[<16]
uavcan.equipment.safety.ArmingStatus message 1100 8700F375556A8003 status:u8
uavcan.equipment.indication.LightsCommand message 1081 2031D93C8BDD1EC4 commands:Light[<20]
uavcan.protocol.debug.LogMessage message 16383 D654A48E0C049D75 level:Level source:u8[<31] text:u8[<90]
uavcan.equipment.gnss.Fix2 message 1063 CA41E7000F37435F timestamp:Stamp gnss_timestamp:Stamp
    gnss_time_standard:u3 :v13 num_leap_seconds:u8 longitude_deg_1e8:i37 latitude_deg_1e8:i37
    height_ellipsoid_mm:i27 height_msl_mm:i27 ned_velocity:f32[3] sats_used:u6 status:u2 mode:u4 sub_mode:u6
    covariance:f16[<36] pdop:f16 ecef_position_velocity:Ecef[<1]
uavcan.protocol.GetNodeInfo.Request request 1 EE468A8121C46A9E
uavcan.protocol.GetNodeInfo.Response response 1 EE468A8121C46A9E status:Status software_version:Software
    hardware_version:Hardware name:u8[<80]
uavcan.protocol.param.GetSet.Request request 11 A7B622F939D1A4D5 index:u13 value:Value name:u8[<92]
uavcan.protocol.param.GetSet.Response response 11 A7B622F939D1A4D5 :v5 value:Value :v5 default_value:Value
    :v6 max_value:Number :v6 min_value:Number name:u8[<92]
uavcan.protocol.param.ExecuteOpcode.Request request 10 3B131AC5EB69D2CD opcode:u8 argument:i48
uavcan.protocol.param.ExecuteOpcode.Response response 10 3B131AC5EB69D2CD argument:i48 ok:u1
uavcan.protocol.file.Read.Request request 48 8DCDCA939F33F678 offset:u40 path:Path
uavcan.protocol.file.Read.Response response 48 8DCDCA939F33F678 error:Error data:u8[<256]
"""
_HOBBYWING = Path(__file__).with_name("hobbywing.txt").read_text()  # from the public DSDL of its ESCs
# Packets inside PUSHSCI (header EC 96) and PUSHCAN (7B 8C), 4.4.4 and 4.4.5: frame id, fields as struct codes.
# Raw values: position 0.01 deg, pwm 0.1 us, throttle 0.4 %, speed rpm, V, A and C in 0.01, rates Hz, times s.
_LIMITS = "acceleration_limit:H deceleration_limit:H rotation_direction:H"
_PACKETS = f"""
PUSHSCI.SetZero 08
PUSHSCI.FocParameters 1E esc_id:H over_voltage_threshold:H over_current_threshold:H over_temperature_threshold:H
    beep_volume:H {_LIMITS} throttle_priority:H led:H bus_rate:B report_rate:H save_option:B
PUSHSCI.FocQuery 1A
PUSHSCI.OutputControl 06 control_mode:B set_point:H reserved:H
PUSHCAN.MotorStatus 15 system_status:B position:H pwm:H throttle:B speed:h voltage:H current:h temperature:H fault:H
    motor_status:B power_on_count:H runtime:H
PUSHCAN.FocFeedback 1E hardware_version:16s software_version:16s {_LIMITS}
    position_loop:H throttle_priority:H led:H bus_rate:B report_rate:H save_option:B
"""


@dataclass(frozen=True, slots=True)
class DataType:
    name: str
    kind: str
    type_id: int
    signature: int
    layout: str


def _rows(table: str, columns: int) -> list[list[str]]:
    """One row a line (an indented line continues it): `columns` words and the rest."""
    rows = re.sub(r"\n +", " ", table.strip()).splitlines()
    return [(row + " ").split(" ", columns) for row in rows]


RECORDS = {name: layout.strip("= ") for name, layout in _rows(_RECORDS, 1)}
TYPES = {row[0]: DataType(*row[:2], int(row[2]), int(row[3], 16), row[4]) for row in _rows(_TYPES + _HOBBYWING, 4)}
PACKETS = {name: (int(number, 16), fields) for name, number, fields in _rows(_PACKETS, 2)}


def packet(name: str, count: int, unit: int, checksum_end: int | None = None, **values: Any) -> bytes:
    """One sub-packet; `unit` is the byte itself (0xA1 = unit 1, 0xFF = all).

    `checksum_end` is the last byte (1-based) of the sum: all before it by default, 28 for FocParameters as printed.
    """
    number, fields = PACKETS[name]
    names, codes = [f.split(":")[0] for f in fields.split()], "".join(f.split(":")[1] for f in fields.split())
    if unknown := set(values) - set(names):
        raise ValueError(f"{name} has no {unknown}")
    body = struct.pack("<" + codes, *(values.get(n, b"" if n.endswith("version") else 0) for n in names))
    whole = bytes([*HEADERS[name[:7]], number, count % 256, unit, len(body) + 7]) + body
    return whole + bytes([sum(whole[:checksum_end]) & 0xFF])


@cache
def parse(layout: str) -> tuple[bool, tuple[tuple[str, str, int, str], ...]]:
    """(union?, one (name, base type, array size, "" | "static" | "dynamic") a field)."""
    words = layout.split()
    union = words[:1] == ["union"]
    fields = []
    for word in words[union:]:
        name, base, less, size = re.fullmatch(r"(\w*):(\w+)(?:\[(<?)(\d+)\])?", word).groups()
        fields.append((name, base, int(size or 0), "" if size is None else "dynamic" if less else "static"))
    return union, tuple(fields)


@cache
def min_bits(base: str) -> int:
    if base not in RECORDS:
        return int(base[1:])
    union, fields = parse(RECORDS[base])
    sizes = [n.bit_length() if how == "dynamic" else min_bits(b) * (n or 1) for _, b, n, how in fields]
    return (len(fields) - 1).bit_length() + min(sizes) if union else sum(sizes)


def scalar(base: str, value: Any) -> str:
    """The bits of one value: whole low-order bytes first, what remains of it high bits first."""
    width = int(base[1:])
    if base[0] == "f" and not isinstance(value, Code):
        value = int.from_bytes(struct.pack({16: "<e", 32: "<f", 64: "<d"}[width], value), "little")
    number, out = int(value) & ((1 << width) - 1), ""
    for low in range(0, width, 8):
        size = min(8, width - low)
        out += format(number >> low & 0xFF, f"0{size}b")
    return out


def pack(*fields: tuple[int, int]) -> bytes:
    """(value, width) pairs as the bytes of a payload."""
    return to_bytes("".join(scalar(f"u{width}", value) for value, width in fields))


def to_bytes(bits: str) -> bytes:
    return bytes(int(bits[i : i + 8].ljust(8, "0"), 2) for i in range(0, len(bits), 8))


def encode(layout: str, value: dict[str, Any], tail: bool) -> str:
    """The bits of a record; `tail`: the last array may stand without its length (classic CAN only)."""
    union, fields = parse(layout)
    out = ""
    for at, (name, base, size, how) in enumerate(fields):
        last = tail and (union or at == len(fields) - 1)
        if union and name not in value:
            continue
        if union:
            out += scalar(f"u{(len(fields) - 1).bit_length()}", at)
        items = [0] if base[0] == "v" else value[name] if how else [value[name]]
        bare = last and how == "dynamic" and min_bits(base) >= 8
        if how == "dynamic" and not bare:
            out += scalar(f"u{size.bit_length()}", len(items))
        for i, item in enumerate(items):
            inner = last and not bare and i == len(items) - 1
            out += encode(RECORDS[base], item, inner) if base in RECORDS else scalar(base, item)
    return out


def crc16(data: bytes, value: int = 0xFFFF) -> int:
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ 0x1021) & 0xFFFF if value & 0x8000 else value << 1
    return value


@cache
def signature_crc(signature: int) -> int:
    return crc16(signature.to_bytes(8, "little"))


@dataclass(frozen=True, slots=True)
class Frame:
    """One CAN frame as a recorder sees it; `t` in ns since 1970, `id` without flag bits."""

    id: int
    data: bytes = b""
    t: int = 0
    bus: str = "can0"
    fd: bool = False
    extended: bool = True
    remote: bool = False
    error: bool = False
    flags: int = 1  # of CAN FD: 1 BRS, 2 ESI, 4 FDF
    dlc: int | None = None  # requested length of a remote frame, or a raw DLC 9..15 of an 8-byte frame
    direction: str = ""  # R, T or not recorded


@dataclass(frozen=True, slots=True)
class Transfer:  # `payload` as encoded, without CRC and FD padding
    kind: str  # message, anonymous, request, response
    type_id: int
    src: int
    payload: bytes
    signature: int
    transfer_id: int = 0
    dst: int | None = None
    priority: int = 31
    fd: bool = False

    @property
    def can_id(self) -> int:
        if self.kind == "anonymous":  # the discriminator as libcanard makes it: bits 14..1 of the payload's CRC
            return self.priority << 24 | (crc16(self.payload) & 0x7FFE) << 9 | (self.type_id & 3) << 8
        if self.kind == "message":
            return self.priority << 24 | self.type_id << 8 | self.src
        call = self.type_id << 16 | (self.kind == "request") << 15 | self.dst << 8 | 0x80
        return self.priority << 24 | call | self.src

    @property
    def padded(self) -> bytes:
        """The payload with the zeros that a CAN FD length needs."""
        room = 63 if self.fd else 7
        size = len(self.payload) if len(self.payload) <= room else len(self.payload) + 2
        last = size % room or min(size, room)
        spare = next(n for n in DLC_LENGTHS if n > last) - 1 - last if self.fd else 0
        return self.payload + bytes(spare)

    @property
    def crc(self) -> int | None:
        """Over signature and padded payload; None where one frame holds the transfer."""
        many = len(self.payload) > (63 if self.fd else 7)
        return crc16(self.padded, signature_crc(self.signature)) if many else None

    def frames(self, t: int = 0, gap: int = 130_000, bus: str = "can0") -> list[Frame]:
        """The frames in order, `gap` ns apart from `t` on."""
        body, room, check = self.padded, 63 if self.fd else 7, self.crc
        if check is not None:
            body = check.to_bytes(2, "little") + body
        parts = [body[i : i + room] for i in range(0, len(body), room)] or [b""]
        can_id, ends = self.can_id, len(parts) - 1
        tails = [(i == 0) << 7 | (i == ends) << 6 | (i & 1) << 5 | self.transfer_id for i in range(len(parts))]
        return [
            Frame(can_id, part + bytes([tail]), t + i * gap, bus, self.fd)
            for i, (part, tail) in enumerate(zip(parts, tails, strict=True))
        ]


def transfer(name: str, fields: dict[str, Any], src: int, transfer_id: int = 0, **more: Any) -> Transfer:
    """A transfer of a type of `TYPES`; `more`: dst, priority, fd, kind="anonymous"."""
    of = TYPES[name]
    payload = to_bytes(encode(of.layout, fields, tail=not more.get("fd", False)))
    kind = more.pop("kind", of.kind)
    return Transfer(kind, of.type_id, src, payload, of.signature, transfer_id % 32, **more)


def duration(frame: Frame) -> int:
    """ns on a 1 Mbit/s bus (5 Mbit/s data phase with BRS), one stuff bit in eleven."""
    bits = 8 * len(frame.data)
    if frame.fd:
        return 30_000 + (bits + bits // 11 + 40) * (200 if frame.flags & 1 else 1000)
    return (67 + bits + (54 + bits) // 11) * 1000


class Bus:
    """One bus: frames that wait when it falls idle go out by the lowest id, stamped at their end, 1 us resolution."""

    def __init__(self, t: int = 0, name: str = "can0") -> None:
        self.now, self.name, self._due, self._count = t, name, [], 0  # _due: by time, then by order of sending

    def send(self, t: int, frames: list[Frame], owner: Any = None) -> None:
        for frame in frames:
            heappush(self._due, (t, self._count, frame, owner))
            self._count += 1

    def run(self) -> list[tuple[Frame, Any]]:
        """All frames in the order of the bus, each with its owner."""
        out, ready = [], []  # ready: by id, then by order of sending
        while self._due or ready:
            if not ready:
                self.now = max(self.now, self._due[0][0])
            while self._due and self._due[0][0] <= self.now:
                _, count, frame, owner = heappop(self._due)
                heappush(ready, (frame.id, count, frame, owner))
            _, _, frame, owner = heappop(ready)
            self.now += duration(frame)
            out.append((replace(frame, t=self.now // 1000 * 1000, bus=self.name), owner))
        return out


def seconds(t: int, digits: int = 6, width: int = 1) -> str:
    return f"{t // 10**9:0{width}}.{t % 10**9:09}"[: digits - 9 or None]


def _number(frame: Frame) -> str:
    return f"{frame.id | frame.error << 29:0{8 if frame.extended or frame.error else 3}X}"


def log_line(frame: Frame, digits: int = 6) -> str:
    """One line of `candump -l` or `-L`."""
    body = frame.data.hex().upper()
    if frame.remote:
        body = "R" + ("" if frame.dlc is None else str(min(frame.dlc, 8)))
    if frame.dlc is not None and frame.dlc > 8:
        body += f"_{frame.dlc:X}"
    mark = f"##{frame.flags:X}" if frame.fd else "#"
    end = f" {frame.direction}" if frame.direction else ""
    return f"({seconds(frame.t, digits, 10)}) {frame.bus} {_number(frame)}{mark}{body}{end}"


def console_line(frame: Frame, stamp: str = "", since: int = 0, extra: bool = False, text: bool = False) -> str:
    """One line of candump on a terminal: `stamp` as -t (a, d, z, A), `since` for d and z, `extra` -x, `text` -a."""
    when = seconds(frame.t, 6, 10) if stamp == "a" else seconds(frame.t - since, 6, 3)
    if stamp == "A":
        when = f"{datetime.fromtimestamp(frame.t // 10**9, UTC):%Y-%m-%d %H:%M:%S}.{frame.t // 1000 % 10**6:06}"
    size = f"[{len(frame.data):02}]" if frame.fd else f" [{frame.dlc or 0 if frame.remote else len(frame.data)}]"
    mode = ("- -", "B -", "- E", "B E")[frame.flags & 3 if frame.fd else 0]
    info = f"  {'TX' if frame.direction == 'T' else 'RX'} {mode}" if extra else ""
    body = frame.data.hex(" ").upper()
    if frame.remote or frame.error:
        body += "remote request" if frame.remote else "   ERRORFRAME"
    elif text:
        shown = "".join(chr(b) if 32 < b < 127 else "." for b in frame.data)
        body = f"{body:<23}   '{shown}'"
    return (f" ({when})" if stamp else "") + f"  {frame.bus}{info}  {_number(frame)}  {size}  {body}"


def drop_line(bus: str, count: int, total: int) -> str:
    return f"DROPCOUNT: dropped {count} CAN frame{'s' if count > 1 else ''} on '{bus}' socket (total drops {total})"
