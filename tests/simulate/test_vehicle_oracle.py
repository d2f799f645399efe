"""pydronecan, which nobody here wrote, accepts every transfer of every clean flight, with the values that were sent."""

from __future__ import annotations

import struct
from typing import Any

import dronecan
import pytest
from dronecan import dsdl
from kit.libraries import plain, received
from kit.simulated import FLIGHT_PLANS, Flown, flown

# Of the six types of the document pydronecan has four by another name.
OTHER_NAMES = {
    "RawCommand": "uavcan.equipment.esc.RawCommand",
    "ESCStatus": "uavcan.equipment.esc.Status",
    "ParamCfg": "com.tmotor.esc.ParamCfg",
    "ParamGet": "com.tmotor.esc.ParamGet",
    "PUSHSCI": "com.tmotor.esc.PUSHSCI",
    "PUSHCAN": "com.tmotor.esc.PUSHCAN",
}
EXPECTED = {
    "tm": {*OTHER_NAMES, "uavcan.protocol.NodeStatus", "uavcan.protocol.GetNodeInfo.Request"},
    "stock": {"RawCommand", "ESCStatus", "uavcan.protocol.NodeStatus", "uavcan.protocol.param.GetSet.Response"},
}


def rounded(layout: Any, value: Any) -> Any:
    """A value as its field holds it: floats have few digits, and pydronecan has text and bytes as lists."""
    if isinstance(layout, dsdl.PrimitiveType):
        form = {16: "<e", 32: "<f"}.get(layout.bitlen, "") if layout.kind == dsdl.PrimitiveType.KIND_FLOAT else ""
        return struct.unpack(form, struct.pack(form, value))[0] if form else int(value)
    if isinstance(layout, dsdl.ArrayType):
        return [rounded(layout.value_type, item) for item in value]
    fields = {member.name: member.type for member in members(layout)}
    return {name: rounded(fields[name], item) for name, item in value.items()}


def members(layout: Any) -> Any:
    return layout if isinstance(layout, list) else layout.fields


def compare(flight: Flown) -> set[str]:
    """Names of the types that both sides agree on; every transfer must."""
    sent = {one.frames[-1].number: one for one in flight.sent}
    seen = set()
    for number, theirs in received(flight.text):
        ours = sent.pop(number)
        full_name = OTHER_NAMES.get(ours.name, ours.name.removesuffix(".Request").removesuffix(".Response"))
        known = dronecan.TYPENAMES[full_name]
        assert theirs.payload._type.full_name == full_name
        kind = ours.message.kind
        layout = known.fields if kind == "message" else getattr(known, f"{kind}_fields")
        assert plain(theirs.payload) == rounded(layout, ours.values), (number, full_name)
        assert (theirs.source_node_id, theirs.transfer_id) == (ours.node, ours.transfer_id)
        assert (theirs.dest_node_id or None, theirs.transfer_priority) == (ours.dst, ours.priority)
        seen.add(ours.name)
    assert not sent
    return seen


@pytest.mark.sampled(4)
@pytest.mark.parametrize("plan", FLIGHT_PLANS)
def test_every_value_of_a_clean_flight(plan: str) -> None:
    seen = compare(flown(flight=plan, escs=4, seed=2))
    assert seen >= EXPECTED["tm"]
    assert ("uavcan.protocol.dynamic_node_id.Allocation" in seen) == (plan == "startup")


@pytest.mark.sampled(2)
@pytest.mark.parametrize("plan", ["mission", "startup"])
def test_every_value_of_stock_escs(plan: str) -> None:
    seen = compare(flown(flight=plan, escs=3, stock=True, seed=3))
    assert seen >= EXPECTED["stock"]
    assert not seen & {"ParamCfg", "ParamGet", "PUSHSCI", "PUSHCAN"}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("escs", [1, 2, 5, 9, 20])
def test_any_number_of_escs(escs: int) -> None:
    assert compare(flown(2, escs=escs)) >= EXPECTED["tm"]
