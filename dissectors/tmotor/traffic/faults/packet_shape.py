"""Faults of what every packet begins and ends with (4.4.4, 4.4.5): PUSH-001 to PUSH-009 but for PUSH-006.

Without other settings each changes one MotorStatus, which nobody waits for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.tmotor.traffic.faults.carried import (
    carries,
    description,
    family,
    misuse,
    read,
    rewrite,
    who,
)
from dissectors.tmotor.traffic.faults.occasions import put
from dissectors.traffic import Fault, Step

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending

_STATUS = carries("MotorStatus")
_OPPOSITE = {"PUSHCAN": "PUSHSCI", "PUSHSCI": "PUSHCAN"}
# A packet that a receiver cannot recognize is missing in the frame counts of its unit.
_UNCOUNTED = ("PUSH-009",)


def _header(case: Case, sending: Sending) -> Step:
    value = int(case.options["header"])
    if not 0 <= value <= 0xFFFF:
        return Step.SKIP
    header = value.to_bytes(2, "big")
    known = {family(case, carrier).header for carrier in _OPPOSITE}
    return Step.SKIP if header in known else rewrite(case, sending, header=header)


def _opposite(case: Case, sending: Sending) -> Step:
    if read(case, sending) is None:
        return Step.SKIP
    return rewrite(case, sending, header=family(case, _OPPOSITE[sending.name]).header)


def _length(case: Case, sending: Sending) -> Step:
    found = read(case, sending)
    return Step.SKIP if found is None else rewrite(case, sending, length=found[1]["length"] + int(case.options["by"]))


def _size(case: Case, sending: Sending) -> Step:
    """Cut bytes off behind the header's fields, or add zeros; length field and all other bytes stay."""
    found, by = read(case, sending), int(case.options["by"])
    if found is None:
        return Step.SKIP
    data = bytes(sending.values["data"])
    size = min(max(len(data) + by, 6), 255)
    if size == len(data):
        return Step.SKIP
    put(sending, "data", data[:size].ljust(size, b"\0"))
    case.say(f"{who(*found)}: {size} bytes instead of the {len(data)} that its length field says")
    return Step.DONE


def _checksum(case: Case, sending: Sending) -> Step:
    found, by = read(case, sending), int(case.options["by"])
    if found is None or not by % 256:
        return Step.SKIP
    data = bytes(sending.values["data"])
    right = {sum(data[:end]) & 0xFF for end in description(case, sending.name, found[0]).checksum_ends}
    wrong = data[-1] + by & 0xFF
    while wrong in right:
        wrong = wrong + 1 & 0xFF
    return rewrite(case, sending, checksum=wrong)


def _frame_id(case: Case, sending: Sending) -> Step:
    if read(case, sending) is None:
        return Step.SKIP
    known = {packet.id for packet in family(case, sending.name).packets}
    return misuse(case, sending, "frame_id", int(case.options["value"]), lambda value: value not in known)


def _unit(case: Case, sending: Sending) -> Step:
    return misuse(case, sending, "unit_id", int(case.options["value"]))


def _count(case: Case, sending: Sending) -> Step:
    """Shift the count of this packet and all later ones of its unit; not of the first, which follows on none."""
    found, by = read(case, sending), int(case.options["by"])
    if found is None or not by % 256 or not found[1]["frame_count"]:
        return Step.SKIP
    if sending.node == case.vehicle.ground.number:
        case.vehicle.station.shift_frame_count(found[1]["unit_id"], by)
    for esc in case.vehicle.escs:
        if esc.node.number == sending.node:
            esc.shift_frame_count(by)
    return rewrite(case, sending, frame_count=(found[1]["frame_count"] + by) % 256)


FAULTS: tuple[Fault, ...] = (
    Fault(
        "PUSH-001",
        "a packet with a header that is no header",
        values=_header,
        fits=_STATUS,
        options={"header": 0x55AA},
        also=_UNCOUNTED,
    ),
    # Who goes by the header looks the frame ID up in the wrong table.
    Fault(
        "PUSH-002",
        "a packet with the header of the other direction",
        values=_opposite,
        fits=_STATUS,
        also=("PUSH-007", *_UNCOUNTED),
    ),
    Fault(
        "PUSH-003",
        "a length field that is not the length of its packet",
        values=_length,
        fits=_STATUS,
        options={"by": 1},
        also=("PUSH-004",),
    ),
    Fault(
        "PUSH-004",
        "a packet that is cut short, or followed by other bytes",
        values=_size,
        fits=_STATUS,
        options={"by": -4},
    ),
    Fault("PUSH-005", "a packet with a wrong checksum", values=_checksum, fits=_STATUS, options={"by": 1}),
    Fault(
        "PUSH-007",
        "a frame ID that the document does not know",
        values=_frame_id,
        fits=_STATUS,
        options={"value": 0x2B},
        also=_UNCOUNTED,
    ),
    Fault(
        "PUSH-008",
        "a power unit ID out of range",
        values=_unit,
        fits=_STATUS,
        options={"value": 0x00},
        also=(*_UNCOUNTED, "PUSH-011", "PUSH-201"),
    ),
    Fault("PUSH-009", "a frame count that jumps", values=_count, fits=_STATUS, options={"by": 7}),
)
