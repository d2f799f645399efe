"""Packets inside PUSHSCI and PUSHCAN on their way: which one a transfer carries, and how it is changed there.

A changed packet has the transfer CRC that belongs to it: only the packet is wrong.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.schema import Bits
from dissectors.tmotor.traffic.faults.occasions import chosen, has_room, put
from dissectors.tmotor.traffic.packets import Raw, change, split
from dissectors.traffic import Step

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dissectors.schema import Note, Packet, PacketFamily
    from dissectors.tmotor.traffic.faults.occasions import Wrong
    from dissectors.traffic import Case, Fits, Sending

_CARRIERS = ("PUSHSCI", "PUSHCAN")
# Fields that people write in hexadecimal.
_CODES = ("frame_id", "unit_id", "checksum", "system_status", "motor_status", "control_mode")
# FOC parameters with a range whose feedback is compared with what was set.
COMPARED = ("throttle_priority", "bus_rate", "report_rate")
# A value to set, where the settings say nothing: whatever is wrong for the field.
UNSAID = -1


def able(case: Case) -> Any | None:
    """Return the ESC that the settings name, else any with a power unit; None if it has none, and so no packets."""
    esc = chosen(case, packets=True)
    return None if esc.unit is None else esc


def asked(case: Case, usual: Mapping[str, int]) -> tuple[str, int] | None:
    """Return field and value of the settings, by default the `usual` wrong value of the field; None for no other."""
    field, value = str(case.options["field"]), int(case.options["value"])
    if field not in usual:
        return None
    return field, usual[field] if value == UNSAID else value


def carries(name: str) -> Fits:
    """Return a test for transfers that hold one whole packet of this name and nothing else."""

    def fits(sending: Sending) -> bool:
        found = carried(sending)
        return found is not None and found[0] == name

    return fits


def carried(sending: Sending, *, big_endian: bool = False) -> tuple[str, dict[str, Any]] | None:
    """Return name and raw values of the packet in a transfer; None if it holds none, or one broken before."""
    if sending.name not in _CARRIERS:
        return None
    try:
        return split(bytes(sending.values["data"]), big_endian=big_endian)
    except ValueError:
        return None


def read(case: Case, sending: Sending) -> tuple[str, dict[str, Any]] | None:
    """Read a packet in the byte order of the ESC that sends it; leave alone what another fault has changed."""
    if sending.changed:
        return None
    return carried(sending, big_endian=_big_endian(case, sending))


def rewrite(case: Case, sending: Sending, **wanted: Any) -> Step:
    """Give fields of the packet other raw values and say so.

    Skips a packet without one of the fields, with one of the values already, or without room for one. The checksum is
    made anew unless it is among them.
    """
    found = read(case, sending)
    if found is None:
        return Step.SKIP
    name, values = found
    layout = description(case, sending.name, name).layout
    if not all(
        field in values and values[field] != value and has_room(layout, field, value) for field, value in wanted.items()
    ):
        return Step.SKIP
    told = ", ".join(
        f"{field} set from {_written(field, values[field])} to {_written(field, value)}"
        for field, value in wanted.items()
    )
    data = bytes(sending.values["data"])
    put(sending, "data", change(data, big_endian=_big_endian(case, sending), **wanted))
    case.say(f"{who(name, values)}: {told}")
    return Step.DONE


def misuse(case: Case, sending: Sending, field: str, value: int, wrong: Wrong | None = None) -> Step:
    """Rewrite to a value that is `wrong`, by default one that the document forbids; skip any other."""
    found = read(case, sending)
    if found is None or field not in found[1]:
        return Step.SKIP
    packet = description(case, sending.name, found[0])
    bad = forbidden(packet, field, value) if wrong is None else wrong(value)
    return rewrite(case, sending, **{field: value}) if bad else Step.SKIP


def family(case: Case, carrier: str) -> PacketFamily:
    """Return the packets that a type carries."""
    found = case.world.message(carrier).packets
    if found is None:
        raise ValueError(f"{carrier} carries no packets")
    return found


def description(case: Case, carrier: str, name: str) -> Packet:
    """Return what the document says of a packet."""
    return next(packet for packet in family(case, carrier).packets if packet.name == name)


def forbidden(packet: Packet, field: str, value: int) -> bool:
    """Return if the document says that a field, or a part of it, cannot have a value for which there is room."""
    note = packet.notes[field]
    if value in note.special or not has_room(packet.layout, field, value):
        return False
    return _outside(note, value) or any(_outside(part, value >> part.low & _ones(part)) for part in note.parts)


def _outside(what: Note | Bits, value: int) -> bool:
    """Return if a value is outside: limits say more than a list of names; a part of all ones is left as it is."""
    if isinstance(what, Bits):
        low, high = what.low_limit, what.high_limit
        if value == _ones(what):
            return False
    else:
        low, high = what.low, what.high
    if low is None and high is None:
        return bool(what.enum) and value not in what.enum
    return (low is not None and value < low) or (high is not None and value > high)


def _ones(part: Bits) -> int:
    return (1 << part.width) - 1


def who(name: str, values: dict[str, Any]) -> str:
    """Return what the key calls a packet."""
    return f"{name} packet of unit 0x{values['unit_id']:02X}, frame count {values['frame_count']}"


def _big_endian(case: Case, sending: Sending) -> bool:
    return any(esc.big_endian for esc in case.vehicle.escs if esc.node.number == sending.node)


def _written(field: str, value: Raw) -> str:
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    return f"0x{value:02X}" if field in _CODES else str(value)
