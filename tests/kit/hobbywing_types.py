"""Types of Hobbywing's ESCs for `kit.encode`, in the form of its own ones: written by hand from the public DSDL."""

from __future__ import annotations

from typing import Any

HOBBYWING = """\
com.hobbywing.esc.GetEscID message 20013 0000000000004E2D payload:u8[<3]
com.hobbywing.esc.StatusMsg1 message 20050 0813B3E2C4AD670E rpm:u16 pwm:u16 status:u16
com.hobbywing.esc.StatusMsg2 message 20051 1675DA01C3B91297 input_voltage:i16 current:i16 temperature:u8
com.hobbywing.esc.StatusMsg3 message 20052 24919CD1EB34ECE9 MOS_T:u8 CAP_T:u8 Motor_T:u8
com.hobbywing.esc.RawCommand message 20100 BDF086C79F6640AD command:i14[<8]
com.hobbywing.esc.SetReportingFrequency.Request request 214 1FD0404420983DEB option:u8 MSG_ID:u16 rate:u8
com.hobbywing.esc.SetReportingFrequency.Response response 214 1FD0404420983DEB option:u8 MSG_ID:u16 rate:u8
com.hobbywing.esc.SelfTest.Request request 216 C48D4DE61C5295DF
com.hobbywing.esc.SelfTest.Response response 216 C48D4DE61C5295DF status:u8
com.hobbywing.esc.GetMajorConfig.Request request 242 1506774DA3930BFD option:u8
com.hobbywing.esc.GetMajorConfig.Response response 242 1506774DA3930BFD direction:u1 throttle_source:u1
    throttle_channel:u6 led_status:u5 led_color:u3 MSG2_rate:u4 MSG1_rate:u4 positioning_angle:u16 reserved:u8[2]
"""
TENTHS = {"com.hobbywing.esc.StatusMsg2": ("input_voltage", "current")}  # fields that are sent in tenths of the unit


def physical(name: str, fields: dict[str, Any]) -> dict[str, Any]:
    """The fields of a type as its table shows them."""
    return {field: value / 10 if field in TENTHS.get(name, ()) else value for field, value in fields.items()}
