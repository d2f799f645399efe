"""Keys of notes: what a profile says of the fields of messages and packets, and of columns computed from them."""

from __future__ import annotations

from dissectors.keys.key import Key, Keys, by_name

_CLAUSE = "Clause of the document; `no 5` is row 5 of the table that the clause of the message or packet names."
_LOW, _HIGH = "Lowest raw value that is not a breach.", "Highest raw value that is not a breach."

PART = Keys("bits.NAME", "Some bits of a whole number.", (
    Key("at", "text", "First and last bit, from 0 for the lowest.", '"12-15"', required=True),
    Key("scale", "scale", "What a raw value is multiplied with.", '"1/100"', "a raw number"),
    Key("unit", "text", "Unit of the scaled value.", '"deg"'),
    Key("enum", "enumeration", "Texts of raw values.", '"OperatingMode"'),
    Key("clause", "text", "Clause of the document.", '"4.4.3"', "that of the field"),
    Key("title", "text", "What people call it.", '"MOS over temperature"', "NAME"),
    Key("tentative", "flag", "The document is not clear here.", "true", "false"),
    Key("low", "number", _LOW, "0"),
    Key("high", "number", _HIGH, "16383"),
))  # fmt: skip

MEASURE = Keys("unit_by.FIELD.VALUE", "How a field is read while another one has this raw value.", (
    Key("scale", "scale", "What a raw value is multiplied with.", "0.1", "a raw number"),
    Key("unit", "text", "Unit of the scaled value.", '"A"'),
    Key("meaning", "text", "What the number is, for people.", '"set current"'),
    Key("high", "number", _HIGH, "3600"),
))  # fmt: skip

AGREES = Keys("agrees", "A number of a message that this one must agree with, which tells a node's byte order.", (
    Key("with", "text", "Message and field.", '"ESCStatus.voltage"', required=True),
    Key("within", "number", "Share of the value, from 0 to below 1, by which they may differ.", "0.02", required=True),
))  # fmt: skip

_NOTE = (
    Key("name", "text", "What people call the field.", '"Throttle"'),
    Key("unit", "text", "Unit of the scaled value, as SI writes it.", '"V"'),
    Key("scale", "scale", "What a raw value is multiplied with, exactly.", '"1/100"', "a raw number"),
    Key("enum", "enumeration", "Texts of raw values.", '{ 0 = "idle", 2 = "spinning" }'),
    Key("special", "enumeration",
        "Texts of raw values that are no numbers, and have no `bits`; no rule calls them wrong.",
        '{ 0xFFFF = "no change" }'),
    Key("bits", "bits", "Parts of an unsigned number; they may not overlap.", '{ stall = 7, mode = { at = "12-15" } }',
        keys=PART, each=Key("NAME", "bits", PART.about, low=0, high=63, keys=PART)),
    Key("low", "number", _LOW, "0xA1"),
    Key("high", "number", _HIGH, "0xA9"),
    Key("clause", "text", _CLAUSE, '"no 5"'),
    Key("text", "flag", "An array of uint8 that is a text.", "true", "false"),
    Key("hex", "flag", "People read the number in hexadecimal.", "true", "false"),
    Key("unit_by", "tables", "Scale and unit that follow another unsigned field of the layout, by its raw value.",
        'unit_by.mode = { 0x44 = { unit = "A" } }', keys=MEASURE,
        each=Key("FIELD", "tables", "", each=Key("VALUE", "table", MEASURE.about, keys=MEASURE))),
)  # fmt: skip
_OF_PACKETS = (
    Key("wraps", "flag", "A counter that begins again at 0; a column `unwrapped` goes on counting.", "true", "false"),
    Key("agrees", "table", AGREES.about, '{ with = "ESCStatus.rpm", within = 0.05 }', keys=AGREES),
)
FIELD = Keys("field.NAME", "A note on one field, by its name in DSDL.", _NOTE)
PACKET_FIELD = Keys("field.NAME of packets", "A note on one field of a packet.", (*_NOTE, *_OF_PACKETS))

PIECE = Keys("pieces", "What is added to raw values in one range.", (
    Key("start", "number", "First raw value of the range.", "0", "no limit"),
    Key("stop", "number", "First raw value behind the range.", "100", "no limit"),
    Key("add", "number", "What is added.", "-40", required=True),
))  # fmt: skip

DERIVED = Keys("derived.NAME", "A column computed from one number of the layout: source times scale plus offset.", (
    Key("source", "text", "The field.", '"temperature"', required=True),
    Key("element", "whole", "Place in an array of numbers, from 0: only this one counts.", "1", "each of them",
        low=0, high=65535),
    Key("scale", "scale", "What its value is multiplied with.", '"1/10"', "1"),
    Key("offset", "number", "What is added.", "-273.15", "0"),
    Key("low", "number", "Lowest raw value that has a value in the column.", "0", "no limit"),
    Key("high", "number", "Highest raw value that has one.", "8191", "no limit"),
    Key("pieces", "rows", PIECE.about, "[{ stop = 50, add = 2 }]", keys=PIECE),
    Key("reading", "text", "A doubtful field of the message: where it is decided for the sender, `by_choice` adds, not "
        "`pieces`.", '"temperature"'),
    Key("by_choice", "table", "What is added, by choice of the reading.", "{ degC = 0, K = -273.15 }",
        each=Key("CHOICE", "number", "What is added.")),
    Key("unit", "text", "Unit of the column.", '"degC"'),
    Key("clause", "text", _CLAUSE, '"no 5"'),
    Key("format", "word", "The number is to be read in another way.", '"date"', words=("date",)),
))  # fmt: skip

FIELDS = by_name("field", FIELD.about, FIELD, 'field.voltage = { unit = "V" }')
PACKET_FIELDS = by_name("field", PACKET_FIELD.about, PACKET_FIELD, "field.count = { wraps = true }")
COLUMNS = by_name("derived", DERIVED.about, DERIVED, 'derived.celsius = { source = "temperature", offset = -273.15 }')
SUMMARY = Key("summary", "text", "One line about it, with columns filled in: `{column}` or `{column:format}`.",
              '"{voltage:.1f} V"')  # fmt: skip

ONLY = Key("only", "text", "Rows of nodes that read a doubtful field so: READING=CHOICE.", '"dialect=tm"')
_LEAST, _MOST = -(1 << 31), (1 << 32) - 1
_REMARK = (
    Key("of", "text", "A whole number, or a part of one (`field.part`). A flag is remarked when it is set; a word with "
        "flags, without a `text`, names those that are set; any other column is remarked unless its value is `usual` "
        "or `special`. A row without `of` has the `text` of lines that have no other remark.", '"state"'),
    Key("text", "text", "What is said, with columns filled in as in `summary`.", '"{state} mode"', "the value's name"),
    Key("usual", "wholes", "Raw values that are not worth a word.", "[2]", low=_LEAST, high=_MOST),
    Key("capitals", "wholes", "Raw values that are said in capital letters.", "[6]", low=_LEAST, high=_MOST),
    Key("changes", "flag", "A value other than the last one of the same sender is said, too, with both names.", "true",
        "false"),
    Key("per", "text", "A field: each value of it has a last one of its own.", '"esc_index"'),
)  # fmt: skip
_REMARKS = "What the line about it says behind its summary, where there is something to remark."
REMARK = Keys("remarks", _REMARKS, (*_REMARK, ONLY))
PACKET_REMARK = Keys("remarks of packets", _REMARKS, _REMARK)
REMARKS = Key("remarks", "rows", _REMARKS, '[{ of = "state", usual = [2], changes = true }]', keys=REMARK)
PACKET_REMARKS = Key("remarks", "rows", _REMARKS, '[{ of = "fault" }]', keys=PACKET_REMARK)
