"""Keys of `profile.toml` and of the packet files that it names."""

from __future__ import annotations

from dissectors.keys.fields import COLUMNS, FIELDS, PACKET_FIELDS, PACKET_REMARKS, REMARKS, SUMMARY
from dissectors.keys.key import Key, Keys, by_name

_MOST_ID = 0xFFFF
_MOST_PACKET = 255

EVIDENCE = Keys("evidence", "What speaks for a choice: values of a field in a range, or messages that a node sends.", (
    Key("choice", "word", "The choice, one of `choices`.", '"tm"', required=True),
    Key("field", "word", "A column of the message.", '"temperature"'),
    Key("low", "number", "Lowest value that speaks for it.", "233", "no limit"),
    Key("stop", "number", "First value above that does not.", "500", "no limit"),
    Key("every", "flag", "Every value must be in the range, not only some.", "true", "false"),
    Key("sends", "texts", "Messages of this profile; a node that sends one has made the choice.", '["PUSHCAN"]'),
))  # fmt: skip

READING = Keys("reading.NAME", "A field that nodes fill in different ways, decided for each node by evidence.", (
    Key("choices", "texts", "Two or more ways to read it.", '["tm", "dronecan"]', required=True),
    Key("field", "text", "The column that is doubtful.", '"error_count"', required=True),
    Key("evidence", "rows", EVIDENCE.about, '[{ choice = "tm", sends = ["PUSHCAN"] }]', required=True, keys=EVIDENCE),
    Key("otherwise", "word", "The choice without evidence, one of `choices`.", '"dronecan"'),
    Key("noted", "word", "The choice that notes on the field hold for, one of `choices`.", '"tm"', "all of them"),
    Key("clause", "text", "Clause of the document.", '"4.4.3"'),
))  # fmt: skip

MESSAGE = Keys("message.NAME, request.NAME, response.NAME", "One type, by the name that its table has.", (
    Key("type", "text", "Full DSDL name; it gives the signature.", '"acme.pump.Pump"', "NAME"),
    Key("dsdl", "text", "Definition file, from this folder, if no tree holds it.", '"20777.Pump.uavcan"'),
    Key("clause", "text", "Clause of the document that defines it.", '"4.4.3"'),
    FIELDS,
    COLUMNS,
    SUMMARY,
    REMARKS,
    Key("aliases", "texts", "Other full names that it answers to.", '["uavcan.equipment.esc.Status"]'),
    Key("prefix", "flag", "Senders may put the length of the last array in front on classic CAN.", "true", "false"),
    Key("packets", "text", "File of the packets that it carries, from this folder.", '"packets/PUSHCAN.toml"'),
    by_name("reading", READING.about, READING),
    Key("turns", "text", "Its sender counts as an ESC; this column is not 0 while its motor turns.", '"rpm"'),
    Key("role", "text", "What its sender is, in a word, for lists of nodes.", '"ESC"'),
    Key("actuates", "flag", "It makes something move, so `simulate` and `replay` ask before they send it.", "true",
        "false"),
))  # fmt: skip

NESTED = Keys("type.NAME", "A type that others nest, by its full name: its notes hold wherever it is nested.", (
    Key("clause", "text", "Clause of the document that defines it.", '"4.4.3"'),
    FIELDS,
))  # fmt: skip

UNDEFINED = Keys("undefined.NAME", "A message type of which only ID and signature are known.", (
    Key("id", "whole", "Its data type ID.", "1035", required=True, low=0, high=_MOST_ID),
    Key("signature", "text", "16 hexadecimal digits.", '"217F5C87D7EC951D"', required=True),
))  # fmt: skip

_TYPES = 'message.Pump = { type = "acme.pump.Pump" }'

PROFILE = Keys("profile.toml", "What DSDL cannot say of the types in a folder.", (
    Key("name", "text", "What people call the profile.", '"Acme"', "the folder's name"),
    Key("version", "text", "Version of the document.", '"1.0"'),
    Key("tree", "text", "Folder of DSDL files, from this one; `.` is this one.", '"."'),
    Key("package", "text", "Folder of DSDL files in an installed Python package, which is not imported.",
        '"dronecan/dsdl_specs"'),
    Key("rules", "text", "Python that judges: a module, or a file `NAME.py` of the folder, with `CONFORMANCE`.",
        '"rules.py"'),
    Key("enum", "tables", "Named enumerations, for the keys `enum` and `special`.", 'enum.State = { 0 = "idle" }',
        each=Key("NAME", "codes", "Texts of raw values; keys are whole numbers, 12 or 0x0C.")),
    by_name("message", "Messages, by the names of their tables.", MESSAGE, _TYPES),
    by_name("request", "Requests of services.", MESSAGE, _TYPES.replace("message", "request")),
    by_name("response", "Responses of services.", MESSAGE, _TYPES.replace("message", "response")),
    by_name("type", "Types that others nest.", NESTED),
    by_name("undefined", "Types of which only ID and signature are known.", UNDEFINED),
))  # fmt: skip


def _place(name: str, what: str, example: str) -> Key:
    return Key(name, "whole", f"Byte that is {what}, from 0.", example, required=True, low=0, high=_MOST_PACKET - 1)


PACKET = Keys("packet.NAME", "One packet, by the name of its table.", (
    Key("dsdl", "text", "Definition file beside this one; 2 to 255 whole bytes of fixed size.",
        '"MotorStatus.uavcan"', required=True),
    Key("id", "whole", "The byte that tells packets of this family apart.", "0x15", required=True, low=0, high=255),
    Key("clause", "text", "Clause of the document that defines it.", '"4.4.5 table 1"'),
    PACKET_FIELDS,
    COLUMNS,
    Key("checksum_ends", "wholes", "Bytes up to which a sender may have summed, this one not included.", "[26, 27]",
        "the last byte", low=1, high=_MOST_PACKET - 1),
    SUMMARY,
    PACKET_REMARKS,
))  # fmt: skip

PACKET_FILE = Keys("packets/NAME.toml", "Packets in a byte array of a message, and what all of them have in common.", (
    Key("carrier", "text", "The byte array of the message.", '"data"', required=True),
    Key("header", "wholes", "Bytes that every packet begins with.", "[0x7B, 0x8C]", required=True, low=0, high=255),
    _place("id_at", "the packet's `id`", "2"),
    _place("count_at", "a frame count", "3"),
    _place("unit_at", "the unit that it is for or from", "4"),
    _place("length_at", "the packet's length", "5"),
    by_name("field", "Notes that hold for every packet; a packet's own replace them.", PACKET_FIELDS.keys or PACKET),
    by_name("derived", "Computed columns of every packet.", COLUMNS.keys or PACKET),
    by_name("packet", "The packets.", PACKET),
))  # fmt: skip
