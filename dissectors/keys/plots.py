"""Keys of `plots.toml`."""

from __future__ import annotations

from dissectors.keys.fields import ONLY
from dissectors.keys.key import Key, Keys, by_name

_MOST_FIRST = 1000
_MOST_IDLE = 10_000

QUANTITY = Keys("quantity.NAME", "Something that is measured or commanded: one plot, with a line for each device.", (
    Key("title", "text", "Its title.", '"Voltage"', required=True),
    Key("unit", "text", "Its unit.", '"V"'),
    Key("detail", "flag", "Nothing to compare devices by, so it is only shown with each of them.", "true", "false"),
))  # fmt: skip

WHO = Keys("who", "Whose values a row holds: the device that a column numbers, or that sends.", (
    Key("path", "text", "What devices are called in paths.", '"esc"', "node"),
    Key("title", "text", "What people call them.", '"ESC"', "that of `path`"),
    Key("column", "text", "Column with the number of the device.", '"esc_index"'),
    Key("elements", "flag", "Each place in a list is a device.", "true", "false"),
    Key("first", "whole", "What the device of number 0 is called.", "1", "0", low=0, high=_MOST_FIRST),
))  # fmt: skip

LINE = Keys('line.QUANTITY, line."QUANTITY/ROLE"', "A quantity's column; a role tells apart what shares a plot.", (
    Key("column", "text", "Field, part (`field.part`) or derived column.", '"voltage"', required=True),
    ONLY,
))  # fmt: skip

STATES = Keys("states.COLUMN", "A column with named values, or a word whose flags and enumerations are lanes.", (
    ONLY,
    Key("motor", "texts", "Flags, or values as `name=value`, that say: the motor does not turn rightly.", '["stall"]'),
    Key("heat", "texts", "The same: something is too hot.", '["over_temperature"]'),
    Key("supply", "texts", "The same: the supply voltage is too low or too high.", '["under_voltage"]'),
    Key("current", "texts", "The same: the current is too large.", '["over_current"]'),
    Key("uncommanded", "texts", "The same: it gets no commands, or wrong ones.", '["throttle_loss"]'),
    Key("electronics", "texts", "The same: its own electronics are broken.", '["bridge_fault"]'),
    Key("failed", "texts", "The same: it has given up.", '["mode=6"]'),
))  # fmt: skip

PRODUCT = Keys("product.QUANTITY", "A quantity that is the product of two others of the same row.", (
    Key("of", "texts", "The two.", '["voltage", "current"]', required=True),
))  # fmt: skip

INTEGRAL = Keys("integral.QUANTITY", "A quantity that adds up another one over seconds.", (
    Key("of", "text", "The other one.", '"power"', required=True),
    Key("scale", "scale", "What the sum is multiplied with.", '"1/3600"', "1"),
))  # fmt: skip

INTERVAL = Keys("interval.QUANTITY", "A quantity that is the time between a sender's rows, in ms.", (
    Key("change", "flag", "How much that time changed.", "true", "false"),
))  # fmt: skip

ESC = Keys("esc", "Columns for the table `esc`: of commands to ESCs the first one, of reports the others.", (
    Key("commanded", "text", "What each ESC is commanded, a list in %.", '"percent"'),
    Key("reported", "text", "What the ESC says it was commanded, in %.", '"percent_seen"'),
    Key("rpm", "text", "Speed in rpm.", '"rpm"'),
    Key("voltage", "text", "In V.", '"voltage"'),
    Key("current", "text", "In A.", '"current"'),
    Key("temperature", "text", "Of the ESC, in degC.", '"temperature"'),
    Key("mode", "text", "Operating mode, with names.", '"status.mode"'),
    Key("faults", "text", "A word whose flags are faults.", '"status"'),
))  # fmt: skip

TABLE = Keys("table.NAME", "What is shown of one table: a message, or MESSAGE.PACKET.", (
    Key("who", "table", WHO.about, '{ path = "esc", column = "esc_index", first = 1 }', "the sender", keys=WHO),
    Key(
        "esc_of", "text", "The column that numbers, from 0, the ESC that a row is about, where `who` is not that ESC.",
        '"esc_index"',
    ),
    Key("idle_rpm", "whole", "A motor that is faster is driven.", "500", "0", low=0, high=_MOST_IDLE),
    by_name("line", LINE.about, LINE, 'line.voltage = { column = "voltage" }'),
    by_name("states", STATES.about, STATES, "states.state = {}"),
    by_name("product", PRODUCT.about, PRODUCT),
    by_name("integral", INTEGRAL.about, INTEGRAL),
    by_name("interval", INTERVAL.about, INTERVAL),
    Key("esc", "table", ESC.about, '{ rpm = "rpm", voltage = "voltage", mode = "status.mode" }', keys=ESC),
    Key("hidden", "texts", "Columns that say nothing that is not shown otherwise.", '["esc_index"]'),
    Key("parameters", "flag", "Its columns are settings, shown beside the commands.", "true", "false"),
    Key("own", "texts", "Of parameters: what is of one device, like counters and dates: no settings.", '["starts"]'),
    Key("identity", "text", "Of parameters: the column that tells one piece of hardware from all others.", '"serial"'),
    Key(
        "turning", "texts", "Of parameters that devices report: which way a motor turns, and what it follows.",
        '["direction"]',
    ),
    Key("saved", "text", "Of a command that sets parameters: the column that says whether they are kept.", '"save"'),
    Key("starts", "text", "The column that counts how often a device was powered up.", '"power_on_count"'),
))  # fmt: skip

PLOTS = Keys("plots.toml", "What a picture shows of the folder's tables; others are shown field by field.", (
    by_name("quantity", "Quantities, in the order of their plots.", QUANTITY),
    by_name("table", "Tables.", TABLE),
))  # fmt: skip
