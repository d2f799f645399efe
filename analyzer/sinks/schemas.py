"""ROS 2 definitions of the messages that carry CAN frames and comments, in the form that MCAP embeds (`ros2msg`)."""

from __future__ import annotations

from typing import NamedTuple


class TypeDefinition(NamedTuple):
    """A message type: full name, and fields with those of the types it uses."""

    name: str
    text: str


_RULE = "=" * 80
_TIME = f"""\
{_RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_HEADER = f"""\
{_RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_TIME}"""

FRAME = TypeDefinition(
    "can_msgs/msg/Frame",
    f"""\
std_msgs/Header header
uint32 id
bool is_rtr
bool is_extended
bool is_error
uint8 dlc
uint8[8] data
{_HEADER}""",
)
FD_FRAME = TypeDefinition(
    "ros2_socketcan_msgs/msg/FdFrame",
    f"""\
std_msgs/Header header
uint32 id
bool is_extended
bool is_error
uint8 len
uint8[<=64] data
{_HEADER}""",
)
LOG = TypeDefinition(
    "rcl_interfaces/msg/Log",
    f"""\
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
{_TIME}""",
)
