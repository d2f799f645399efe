"""Faults of ParamGet (4.4.6): TYP-401 to TYP-404. The ground station asks for the reports that show them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND
from dissectors.tmotor.traffic.faults.occasions import chosen, provoke, put, replaced
from dissectors.traffic import Fault, Step

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending, Touch

# Between two questions at 1 Mbit/s: the first has been answered.
_PAUSE = 50 * MILLISECOND
# What a copied memory brings along, besides the UUID.
_LIFETIME = ("esc_startup_times", "esc_startup_duration", "esc_error_count")


def _then(case: Case, first: Any, esc: Any, do: Touch) -> None:
    """Ask one ESC for its parameters as they are, then one for what `do` makes of them."""
    world = case.world
    case.vehicle.configure(first.index, esc_save_option=0)
    world.at(world.now + _PAUSE * 1_000_000 // world.bit_rate, lambda: provoke(case, "ParamGet", "values", do, esc))


def _reserved(case: Case) -> None:
    size = int(case.options["bytes"])

    def resize(case: Case, sending: Sending) -> Step:
        if size in {0, 32} or not 0 <= size <= 255:
            return Step.SKIP
        before = put(sending, "rsvd", bytes(size))
        case.say(f"rsvd has {size} bytes instead of {len(before)}; the document has 32")
        return Step.DONE

    provoke(case, "ParamGet", "values", resize, chosen(case))


def _backward(case: Case) -> None:
    """Leave the first report of one ESC right; the second and all later ones lag behind it."""
    esc, field, by = chosen(case), str(case.options["field"]), int(case.options["by"])

    def lower(case: Case, sending: Sending) -> Step:
        drop = min(by, esc.parameters[field])
        if drop < 1:
            return Step.SKIP
        esc.parameters[field] -= drop
        return replaced(case, sending, field, sending.values[field] - drop)

    _then(case, esc, esc, lower)


def _identity(case: Case) -> None:
    """Report the UUID and the counters of an ESC's neighbour or, if it is alone, another UUID than before."""
    esc = chosen(case)
    other = next((other for other in case.vehicle.escs if other is not esc), esc)
    uuid = esc.uuid ^ 1 if other is esc else other.uuid

    def pretend(case: Case, sending: Sending) -> Step:
        for name in _LIFETIME:
            put(sending, name, sending.values[name] - esc.parameters[name] + other.parameters[name])
        sending.damaged = True  # the ground station goes on to address the ESC by the right one
        return replaced(case, sending, "esc_uuid", uuid)

    _then(case, other, esc, pretend)


def _date(case: Case) -> None:
    value = int(case.options["value"])
    provoke(
        case,
        "ParamGet",
        "values",
        lambda case, sending: replaced(case, sending, "esc_product_date", value),
        chosen(case),
    )


FAULTS: tuple[Fault, ...] = (
    Fault(
        "TYP-401",
        "a report with a reserved block that is not 32 bytes long",
        start=_reserved,
        options={"bytes": 16},
    ),
    Fault(
        "TYP-402",
        "a lifetime counter goes backwards",
        start=_backward,
        options={"field": "esc_startup_times", "by": 5},
        choices={"field": _LIFETIME},
    ),
    Fault("TYP-403", "two ESCs with one UUID", start=_identity, also=("BUS-010", "BUS-011", "BUS-012", "BUS-013")),
    # 3 July 2024 in seconds since 1970, where all the others write the day as YYYYMMDD.
    Fault(
        "TYP-404",
        "a production date in a format of its own",
        start=_date,
        options={"value": 1_719_964_800},
    ),
)
