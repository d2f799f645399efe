"""Error frames: what they say, and which only say that the driver lost frames."""

from __future__ import annotations

from functools import lru_cache

# Error classes (linux/can/error.h), and the bits of the data bytes that say more.
_CLASSES = {
    0x001: "transmit timeout",
    0x002: "lost arbitration",
    0x010: "transceiver error",
    0x020: "no acknowledge",
    0x040: "bus-off",
    0x100: "restarted",
}
CONTROLLER, _PROTOCOL, _BUS_ERROR = 0x004, 0x008, 0x080
_OVERFLOW = 0x01  # of the receive buffer
_OF_CONTROLLER = {
    0x02: "transmit overflow",
    0x04: "receive warning",
    0x08: "transmit warning",
    0x10: "receive passive",
    0x20: "transmit passive",
    0x40: "error active again",
}
_OF_PROTOCOL = {
    0x01: "bit error",
    0x02: "form error",
    0x04: "stuffing error",
    0x08: "bit error (dominant)",
    0x10: "bit error (recessive)",
    0x20: "overload",
}
_CRC_PLACES = (0x08, 0x18)  # CRC sequence and delimiter, in byte 3
_ACK_PLACES = (0x19, 0x1B)


@lru_cache(maxsize=1024)
def kind_of(error_class: int, data: bytes) -> str:
    """Return an error frame in words."""
    more = data.ljust(4, b"\0")
    said = [text for bit, text in _CLASSES.items() if error_class & bit]
    if error_class & CONTROLLER:
        said += _named(_OF_CONTROLLER, more[1]) or ["controller error"]
    if error_class & _PROTOCOL:
        place = "CRC error" if more[3] in _CRC_PLACES else "no acknowledge" if more[3] in _ACK_PLACES else ""
        said += _named(_OF_PROTOCOL, more[2]) or [place or "protocol violation"]
        if place and place not in said:
            said.append(place)
    if not said:
        said = ["bus error" if error_class & _BUS_ERROR else f"class 0x{error_class:03X}"]
    return " and ".join(dict.fromkeys(said))


def _named(names: dict[int, str], bits: int) -> list[str]:
    return [text for bit, text in names.items() if bits & bit]


def overflowed(error_class: int, data: bytes) -> bool:
    """Return whether an error frame says that the receive buffer was too small."""
    return bool(error_class & CONTROLLER and len(data) > 1 and data[1] & _OVERFLOW)
