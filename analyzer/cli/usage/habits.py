"""Names of the same thing elsewhere: words that hands know from tshark, can-utils, cantools, git and others."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Mapping

_Meant = TypeVar("_Meant")


def _each(table: Mapping[str, _Meant]) -> dict[str, _Meant]:
    """Return the table with a row for each word of its keys."""
    return {word: meant for words, meant in table.items() for word in words.split()}


# Commands: words, and what they may mean here. The first that exists counts.
COMMANDS = _each(
    {
        "dump list show print parse read cat tshark": ("decode",),
        "capinfos summary summarize summarise describe nodes": ("info",),
        "stat statistics": ("stats", "info"),
        "validate verify lint judge analyze analyse test": ("check",),
        "rule rules": ("explain",),
        "man manual docs doc": ("help",),
        "log2asc asc2log log2long editcap mergecap merge cut": ("convert",),
        "graph chart draw rerun": ("plot",),
        "candump monitor sniff watch listen capture record dumpcap cansniffer": ("live",),
        "interfaces": ("live -D",),
        "play canplayer send": ("replay",),
        "cangen generate gen fake": ("simulate",),
        "compare": ("diff",),
        "completions": ("completion",),
        "version": ("--version",),
    }
)

# Options that are commands of their own here.
INSTEAD = {
    "-G": "fields", "--fields-list": "fields", "--list-rules": "explain --list", "--stats": "stats", "-w": "convert",
}  # fmt: skip

# Options that there are none of: the option that the words speak of, "" for none, and what to do instead. The first one
# whose option the command has counts.
TOLD = _each(
    {
        "-n -N": (
            ("-c", "nothing here is looked up by name; the first N rows are -c N"),
            ("", "nothing here is looked up by name"),
        ),
        "-f": (
            (
                "--follow",
                "a capture filter is for a bus that runs; rows are chosen by -Y FILTER (tail -f: --follow)",
            ),
            ("-Y", "a capture filter is for a bus that runs; rows are chosen by -Y FILTER"),
        ),
        "-l": (("--follow", "each line is written at once with --follow"),),
        "-C": (("", "there are no configuration profiles; every setting is an option"),),
        "-2": (("-Y", "a filter looks back and ahead by itself"),),
        "-S": (("-T", "for programs there are -T jsonl, json, csv and fields"),),
        "-o": (("-Y", "there are no preferences; files are written by tailbyte convert and tailbyte export"),),
        "-X": (("--dissector", "types of your own are --dissector DIR"),),
        "-p -I": (("-i", "there is no such mode on CAN: a controller receives everything"),),
        "-8": (("-x", "bytes are shown by -x"),),
    }
)

# Values of options.
VALUES = _each(
    {
        "ek ndjson jsonlines": ("jsonl",),
        "z zero": ("r",),
        "pdml psml xml jsonraw": ("json",),
        "tabs tsv": ("fields",),
        "txt plain": ("text",),
    }
)

# Options, in the same way; the first word of a meaning is the option, and the command has to have it.
OPTIONS = _each(
    {
        "--count --limit --head --max-count": ("-c",),
        "-R --display-filter --where": ("-Y",),
        "--stat --statistics": ("-z",),
        "--json": ("-T json",),
        "-E": ("-T csv",),
        "--jsonl --ndjson": ("-T jsonl",),
        "--csv": ("-T csv",),
        "--output-format --form": ("-F", "-T"),
        "--format": ("-T",),
        "-v --verbose --details --detail": ("-V",),
        "--quiet --silent": ("-q",),
        "--output --out --write -o -w": ("-o", "-w"),
        "--record --log --save": ("-w",),
        "--start --since --begin --after": ("--from",),
        "--end --stop --until --before": ("--to",),
        "--tail": ("--last",),
        "--iface --device": ("-i",),
        "-b -s -B --baud --baudrate --bit-rate": ("--bitrate",),
        "--list-interfaces": ("-D",),
        "--duration --timeout": ("-a duration:TIME",),
        "-l": ("--loop",),
        "-d --dbc --dsdl --database --types-from": ("--dissector",),
        "--no-color --no-colour --nocolor": ("--color never",),
        "--colour": ("--color",),
        "--rule --rules --only --enable": ("--select",),
        "--exclude --skip --disable": ("--ignore",),
        "--config --expect": ("--vehicle",),
        "-f": ("--force",),
        "--overwrite -y": ("--force",),
        "--field --fields --columns": ("-e",),
        "--hex --bytes --hexdump": ("-x",),
        "-u": ("-t",),
        "--enable-protocol --disable-protocol": ("-Y",),
        "-a": ("--to",),
        "-L": ("-w",),
        "-j --jobs": ("--threads",),
    }
)
