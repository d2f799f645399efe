"""Names of the same thing elsewhere: words that hands know from tshark, can-utils, cantools, git and others."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping


def _each(table: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
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

# Values of options.
VALUES = _each(
    {
        "ek ndjson jsonlines": ("jsonl",),
        "pdml psml xml jsonraw": ("json",),
        "tabs tsv": ("fields",),
        "txt plain": ("text",),
    }
)

# Options, in the same way; the first word of a meaning is the option, and the command has to have it.
OPTIONS = _each(
    {
        "-n --count --limit --head --max-count": ("-c",),
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
        "-f": ("--follow", "--force"),
        "--overwrite -y": ("--force",),
        "--field --fields --columns": ("-e",),
        "--hex --bytes": ("-x",),
        "-j --jobs": ("--threads",),
    }
)
