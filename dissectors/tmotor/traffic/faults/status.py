"""Faults of a single ESCStatus (4.4.3): TYP-010, TYP-201, TYP-302 to TYP-304 and TYP-308."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.tmotor.traffic.faults.occasions import chosen, provoke, put, replaced
from dissectors.traffic import Fault, Step, of

if TYPE_CHECKING:
    from dissectors.traffic import Case, Fits, Sending

STATUS = of("ESCStatus")


def status_of(node: int) -> Fits:
    """Return a test for the reports of one node."""
    return lambda sending: STATUS(sending) and sending.node == node


# What nobody measures, where the settings say nothing (V, A, degC or K, rpm).
_IMPLAUSIBLE = {"voltage": 150.0, "current": 1500.0, "temperature": -100.0, "rpm": 120_000.0}
_PLAUSIBLE = {"voltage": (0, 120), "current": (-1000, 1000), "temperature": (-60, 500), "rpm": (-100_000, 100_000)}
# Who reports an index that no ESC has: what else a receiver may say of it.
_STRANGER = {
    "ESCStatus": ("TYP-103", "BUS-025", "BUS-026", "PUSH-011"),
    "ParamCfg": ("BUS-011", "BUS-015"),
}


def _index(case: Case) -> None:
    name, value = str(case.options.get("type", "ESCStatus")), int(case.options["value"])
    case.answer.also = _STRANGER.get(name, ())

    def replace(case: Case, sending: Sending) -> Step:
        most = 31 if sending.name == "ESCStatus" else 254
        return replaced(case, sending, "esc_index", value, lambda value: 19 < value <= most)

    provoke(case, name, "values", replace, chosen(case))


def _throttle(case: Case, sending: Sending) -> Step:
    value = int(case.options["value"])
    return replaced(case, sending, "power_rating_pct", value, lambda value: 100 < value < 128)


def _part(case: Case, sending: Sending, name: str, low: int, width: int, right: range) -> Step:
    """Replace bits of the status word; skip a word that counts errors, which has no operating mode."""
    before, mask = sending.values.get("error_count", 0), (1 << width) - 1
    value = int(case.options["value"])
    if not 1 <= before >> 12 & 15 <= 8 or value in right or not 0 <= value <= mask:
        return Step.SKIP
    after = before & ~(mask << low) | value << low
    put(sending, "error_count", after)
    case.say(f"{name} set from {before >> low & mask} to {value}, the status word is 0x{after:08X}")
    return Step.DONE


def _encoder(case: Case, sending: Sending) -> Step:
    return _part(case, sending, "encoder value (bits 16 to 31)", 16, 16, range(16_384))


def _mode(case: Case, sending: Sending) -> Step:
    return _part(case, sending, "operating mode (bits 12 to 15)", 12, 4, range(1, 9))


def _implausible(case: Case, sending: Sending) -> Step:
    field = str(case.options["field"])
    value = float(case.options["value"]) or _IMPLAUSIBLE[field]
    low, high = _PLAUSIBLE[field]
    wanted = min(max(round(value), -0x20000), 0x1FFFF) if field == "rpm" else value
    return replaced(case, sending, field, wanted, lambda value: not low <= value <= high)


def _lsb_first(sending: Sending) -> bytes:
    """Pack the last three fields as a C compiler does: from the lowest bit on, two left over at the top."""
    values = sending.values
    bits = values["rpm"] & 0x3FFFF | (values["power_rating_pct"] & 0x7F) << 18 | (values["esc_index"] & 0x1F) << 25
    return int(bits).to_bytes(4, "little")


def _shows_packing(sending: Sending) -> bool:
    """Return if the last two bits of a status, zero as padding, are not when it is packed the other way."""
    return STATUS(sending) and _lsb_first(sending)[3] & 3 != 0


def _packing(case: Case, sending: Sending) -> Step:
    if not _shows_packing(sending):
        return Step.SKIP
    right, wrong = sending.payload[10:14], _lsb_first(sending)
    sending.payload = sending.payload[:10] + wrong
    case.say(
        f"rpm, power_rating_pct and esc_index packed from the lowest bit on: bytes 11 to 14 are "
        f"{wrong.hex(' ').upper()} instead of {right.hex(' ').upper()}"
    )
    return Step.DONE


FAULTS: tuple[Fault, ...] = (
    Fault(
        "TYP-010",
        "the last fields of a status are packed from the lowest bit on",
        transfer=_packing,
        fits=_shows_packing,
        also=("TYP-003", "TYP-302", "TYP-308", "PUSH-011", "PUSH-409", "BUS-009"),
    ),
    Fault("TYP-201", "an ESC index above 19", start=_index, options={"value": 25}),
    Fault("TYP-302", "a throttle above 100 %", values=_throttle, fits=STATUS, options={"value": 110}),
    Fault(
        "TYP-303",
        "an encoder value above 16383",
        values=_encoder,
        fits=STATUS,
        options={"value": 20_000},
        also=("BUS-032",),
    ),
    Fault(
        "TYP-304", "an operating mode that the document does not know", values=_mode, fits=STATUS, options={"value": 9}
    ),
    Fault(
        "TYP-308",
        "telemetry that no ESC can measure",
        values=_implausible,
        fits=STATUS,
        options={"field": "voltage", "value": 0.0},
        choices={"field": tuple(_IMPLAUSIBLE)},
        also=("PUSH-409",),
    ),
)
