"""Faults of RawCommand (4.4.1): TYP-101 to TYP-105; each is one command, or a row of them with wrong channels."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.faults.occasions import put
from dissectors.traffic import Fault, Step, of

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending

_COMMAND = of("RawCommand")
# The lowest number of 14 bits, which the document leaves out.
_LOWEST = -8192


def _set(case: Case, sending: Sending, value: int) -> Step:
    """Give the channel of the settings another throttle."""
    cmd, channel = list(sending.values["cmd"]), int(case.options["channel"])
    if not 0 <= channel < len(cmd):
        return Step.SKIP
    before, cmd[channel] = cmd[channel], value
    put(sending, "cmd", cmd)
    case.say(f"cmd[{channel}] (ch{channel + 1}) set from {before} to {value}")
    return Step.DONE


def _negative(case: Case, sending: Sending) -> Step:
    value = int(case.options["value"])
    return _set(case, sending, value) if -8191 <= value < 0 else Step.SKIP


def _lowest(case: Case, sending: Sending) -> Step:
    return _set(case, sending, _LOWEST)


def _channels(case: Case, sending: Sending) -> Step:
    """Add idle channels, or leave the last ones out, in a row of commands."""
    cmd, more = list(sending.values["cmd"]), int(case.options["more"])
    wanted = len(cmd) + more
    if not more or not 0 < wanted <= 20:
        return Step.SKIP
    put(sending, "cmd", cmd[:wanted] + [0] * more)
    left = case.state["left"] = case.state.get("left", int(case.options["commands"])) - 1
    case.answer.also = ("BUS-027",) if more > 0 else ("BUS-026", "BUS-017", "TYP-305", "PUSH-410")
    case.say(f"{int(case.options['commands']) - left} commands with {wanted} channels for {len(cmd)} ESCs")
    return Step.MORE if left > 0 else Step.DONE


def _empty(case: Case, sending: Sending) -> Step:
    before = put(sending, "cmd", [])
    case.say(f"no channels instead of {len(before)}, a payload of 0 bytes")
    return Step.DONE


def _words(case: Case, sending: Sending) -> Step:
    return _array(case, sending) if case.options["how"] == "array" else _word(case, sending)


def _array(case: Case, sending: Sending) -> Step:
    """Send all channels as two bytes each, low byte first, in a row of commands."""
    cmd = sending.values["cmd"]
    left = case.state.get("left", int(case.options["commands"]))
    if not any(value >> 8 & 3 for value in cmd) and "left" not in case.state:
        return Step.SKIP
    sending.payload = b"".join(value.to_bytes(2, "little", signed=True) for value in cmd)
    case.state["left"] = left = left - 1
    case.answer.also = (*_MISREAD, "BUS-026", "BUS-027")
    case.say(f"{int(case.options['commands']) - left} commands with 16 bits for each of {len(cmd)} channels")
    return Step.MORE if left > 0 else Step.DONE


def _word(case: Case, sending: Sending) -> Step:
    """Send one channel as two bytes, the two high bits cut off, in a frame that is filled with zeros."""
    low, high = (int(case.options["value"]) & 0x3FFF).to_bytes(2, "little")
    if not high & 3:
        return Step.SKIP
    channels = len(sending.values["cmd"])
    sending.payload = bytes((low, high)) + bytes(5)
    if channels != 4:
        case.answer.also = ("TYP-103", "BUS-026" if channels > 4 else "BUS-027")
    case.say(
        f"throttle {int(case.options['value'])} of ch1 as a 16-bit word: payload {sending.payload.hex(' ').upper()}, "
        f"which reads as {[low | high >> 2 << 8, (high & 3) << 6, 0, 0]}"
    )
    return Step.DONE


# What else is said of throttles that are unpacked with 14 bits.
_MISREAD = ("TYP-003", "TYP-004", "TYP-101", "TYP-102", "TYP-103", "TYP-305", "BUS-016", "BUS-028")
_ONLY = {"type": ("RawCommand",)}

FAULTS: tuple[Fault, ...] = (
    Fault(
        "TYP-101",
        "a throttle is negative",
        values=_negative,
        fits=_COMMAND,
        choices=_ONLY,
        options={"channel": 0, "value": -1000},
        also=("TYP-305", "PUSH-410"),
    ),
    Fault(
        "TYP-102",
        "a throttle is -8192",
        values=_lowest,
        fits=_COMMAND,
        choices=_ONLY,
        options={"channel": 0},
        also=("TYP-101", "TYP-305", "PUSH-410"),
    ),
    Fault(
        "TYP-103",
        "the number of throttle channels is not that of the ESCs",
        values=_channels,
        fits=_COMMAND,
        choices=_ONLY,
        options={"more": 1, "commands": 80},
        lasts=200 * MILLISECOND,
    ),
    Fault(
        "TYP-104",
        "a throttle command without channels",
        values=_empty,
        fits=_COMMAND,
        choices=_ONLY,
        also=("TYP-103", "BUS-026"),
    ),
    Fault(
        "TYP-105",
        "a throttle packed as a 16-bit word",
        transfer=_words,
        fits=_COMMAND,
        options={"value": 1000, "how": "word", "commands": 80},
        choices={**_ONLY, "how": ("word", "array")},
        lasts=SECOND // 4,
    ),
)
