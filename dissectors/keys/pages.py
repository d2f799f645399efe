"""Keys of the pages of rules, and of the clauses that no rule can check."""

from __future__ import annotations

from dissectors.keys.key import Key, Keys

SEVERITIES = ("error", "warning", "note")
CATEGORIES = ("protocol", "device", "capture")
ORIGINS = ("document", "implied", "dronecan", "heuristic")
# What a capture may or may not record.
PROOFS = ("times", "drops", "errors", "bit rate", "hardware times", "end")
TESTS = ("range", "enum", "zero", "backwards")


def _text(name: str, about: str, example: str) -> Key:
    return Key(name, "text", about, example, required=True)


TEST = Keys("tests", "A check of single fields, so that a rule needs no code.", (
    Key("kind", "word", "`range`: outside `low` to `high` of the test, else of the field's note. `enum`: a code that "
        "the note does not name. `zero`: not 0. `backwards`: lower than before in the same node. What the note calls "
        "`special` is never wrong.", '"range"', required=True, words=TESTS),
    Key("fields", "texts", "Message or packet, and field or part.", '["ParamGet.esc_timing"]', required=True),
    Key("low", "number", "Lowest raw value of a `range`.", "0", "that of the note"),
    Key("high", "number", "Highest raw value of a `range`.", "30", "that of the note"),
    Key("per", "text", "Of `backwards`: each value of this field has a counter of its own.", '"unit_id"'),
    Key("physical", "text", "Name under which `text` has the scaled number.", '"degrees"'),
))  # fmt: skip

SETTINGS = Key("settings", "tables", "Numbers that nobody prescribes; a vehicle file may change them.",
               "{ window_s = 2 }", each=Key("NAME", "number", "A number; its name ends with its unit."))  # fmt: skip

PAGE = Keys("LAYER-NUMBER", 'One rule, as in `["TYP-208"]`. Layers: CAN, TRF, TYP, PUSH, BUS, CAP, or your own.', (
    _text("title", "The rule in a few words.", '"Pressure too high"'),
    Key("severity", "word", "How bad a breach is.", '"warning"', required=True, words=SEVERITIES),
    Key("category", "word", "Whose fault it is: the sender's software, a device's state, or the recorder's.",
        '"device"', CATEGORIES[0], words=CATEGORIES),
    Key("origin", "word", "Where the rule is from: printed in the document, implied by it, the DroneCAN specification, "
        "or experience.", '"document"', required=True, words=ORIGINS),
    Key("clause", "text", "Clause of the vendor's document.", '"4.4.3"'),
    Key("dronecan", "text", "Chapter of the DroneCAN specification.", '"4.1 frame format"'),
    Key("enabled", "flag", "It is looked for unless it is switched off.", "false", "true"),
    _text("checks", "What is compared, exactly.", '"Reports with more than 10 bar."'),
    _text("matters", "Why anybody should care.", '"The hose bursts at 12 bar."'),
    _text("example", "What a breach looks like.", '"14.2 bar"'),
    _text("next", "What to do now.", '"Look at the valve."'),
    _text("text", "The line of a finding: `{value}` of an occurrence, as Python formats it.", '"{pressure:.1f} bar"'),
    Key("episode", "text", "The line of a finding that tells a state that lasts, in place of `text`, which its "
        "examples have: also how long it `{lasted}`, and `{worst_NAME}` of each number whose worst the rule keeps.",
        '"{pressure:.1f} bar {lasted}, at worst {worst_pressure:.1f} bar"'),
    Key("values", "texts", "All values that occurrences have.", '["pressure"]', "those of `text` and `key`"),
    Key("key", "texts", "Values that keep findings apart, beside rule, bus, node and type.", "[]"),
    SETTINGS,
    _text("exercised", "What a capture must hold, else the rule was not exercised: `,` is and, `|` is or. "
          "Words: frames, transfers, services, multi-frame, fd, anonymous, arrays, floats, unions, voids, padded "
          "types, unknown types, several types, several interfaces, CRC failures, type:NAME, packet:NAME, pair:A>B (A, "
          "and B after it), and those of the folder's exercises.", '"type:Pump"'),
    Key("inconclusive", "words", "What a capture must record; without it a rule that found nothing is INCONCLUSIVE, "
        "not PASS.", '["times"]', words=PROOFS),
    Key("tests", "rows", TEST.about, '[{ kind = "range", fields = ["Pump.pressure"] }]', keys=TEST),
    Key("judges", "texts", "Fields that the rule's code judges, so that TYP-013 and TYP-014 leave them to it.",
        '["Pump.pressure"]'),
    Key("note", "text", "When the severity is another one.", '"Note before the first command."'),
    Key("also", "texts", "Rules that may fire for the same cause.", '["TYP-302"]'),
    Key("explained", "texts", "Rules whose findings of the same node explain these, which are notes then.",
        '["TRF-010"]'),
    Key("event", "flag", "What it finds is no breach but something that devices did: it stands among the events of a "
        "report. Findings of the same node that it explains (`explained`) from then on are left out.", "true", "false"),
    Key("drops", "flag", "Breaches are notes where the recorder lost frames, which may be why.", "true", "false"),
    Key("fault", "flag", "One act of a sender or recorder can bring it about, so `simulate` has a fault of this name.",
        "true", "false"),
))  # fmt: skip

PAGES = Keys("rules.toml, rules/**/*.toml", "The pages of rules, one table each; a rule has one page.", (),
             Key("LAYER-NUMBER", "table", PAGE.about, keys=PAGE))  # fmt: skip

NEVER = Keys("never", "A clause that no capture can show.", (
    _text("clause", "The clause.", '"3.1"'),
    _text("why", "Why not.", '"connectors and wires"'),
))  # fmt: skip

CLAUSES = Keys("clauses.toml", "Clauses of the document that no rule can check.", (
    Key("never", "rows", NEVER.about, 'never = [{ clause = "3.1", why = "connectors and wires" }]', keys=NEVER),
))  # fmt: skip

PRINTED = Keys("printed.toml", "Words that the document prints, so that `explain` finds what they are called here.", (
    Key("name", "table", "Printed names of fields and of parts of fields.", 'name."Pump.pressure" = "Hose pressure"',
        each=Key("MESSAGE.FIELD", "text", "The word as it is printed.")),
    Key("value", "tables", "Printed names of values.", 'value."Pump.state" = { 2 = "Motor is spinning" }',
        each=Key("MESSAGE.FIELD", "codes", "Words of raw values.")),
))  # fmt: skip
