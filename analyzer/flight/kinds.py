"""The kinds of events, and what each says."""

from __future__ import annotations

KINDS = {
    "fault": "a fault bit of a device, from its onset to its end",
    "mode": "a device goes into another mode",
    "health": "a node's health changes",
    "commands stop": "who commands ESCs falls silent",
    "commands zero": "all ESCs are commanded 0 after they were commanded more",
    "saturation": "an ESC is commanded all there is",
    "motor": "an ESC's speed or current is not what it was at such a command",
    "spread": "ESCs are commanded very different throttles",
    "silence": "who sent evenly falls silent",
    "rate": "who sent evenly goes slower",
    "restart": "a node's uptime begins anew",
    "join": "a node is heard for the first time",
    "parameter": "somebody sets a parameter, or a device reports another value than before",
    "save": "parameters are to be saved or erased, and whether that was done",
    "power-up": "a device's own counter says that it was powered up again",
    "arming": "the vehicle is armed or disarmed",
    "message": "a node says something in words (LogMessage)",
    "sag": "a supply voltage falls faster than a pack is emptied, at once or in seconds",
    "errors": "error frames, close together",
    "bus state": "the recorder's controller goes into another state",
    "loss": "the recorder says that it lost frames",
    "gap": "nothing was recorded for too long",
    "clock": "the clock of the recording steps",
    "autopilot error": "the autopilot's log says that something failed, or works again (ERR)",
    "autopilot event": "the autopilot's log says what it did or noticed (EV)",
    "low battery": "the autopilot's log has a voltage below what its parameters call low",
}
