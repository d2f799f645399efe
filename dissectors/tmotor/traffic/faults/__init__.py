"""The faults of T-Motor devices, one file a kind."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.tmotor.traffic.faults import (
    bus_commands,
    bus_rates,
    bus_reports,
    confirmed,
    device,
    flight,
    habits,
    packet_commands,
    packet_control,
    packet_feedback,
    packet_habits,
    packet_shape,
    packet_status,
    prefix,
    reports,
    sequence,
    settings,
    status,
    throttle,
    transport,
)

if TYPE_CHECKING:
    from dissectors.traffic import Fault

FAULTS: tuple[Fault, ...] = (
    *transport.FAULTS,
    *prefix.FAULTS,
    *habits.FAULTS,
    *status.FAULTS,
    *throttle.FAULTS,
    *settings.FAULTS,
    *device.FAULTS,
    *flight.FAULTS,
    *reports.FAULTS,
    *sequence.FAULTS,
    *packet_shape.FAULTS,
    *packet_habits.FAULTS,
    *packet_commands.FAULTS,
    *packet_control.FAULTS,
    *packet_feedback.FAULTS,
    *packet_status.FAULTS,
    *bus_commands.FAULTS,
    *bus_reports.FAULTS,
    *bus_rates.FAULTS,
    *confirmed.FAULTS,
)
