"""The types in which a node says who and how it is, and the names of what they say."""

from __future__ import annotations

NODE_STATUS = "uavcan.protocol.NodeStatus"
NODE_INFO = "uavcan.protocol.GetNodeInfo.Response"
HEALTHS = ("ok", "warning", "error", "critical")
MODES = {0: "operational", 1: "initialization", 2: "maintenance", 3: "software update", 7: "offline"}
