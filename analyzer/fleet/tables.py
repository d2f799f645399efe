"""The tables of a fleet's store: columns and meaning, frozen by a test.

Every row names the capture by `key` and the run that wrote it by `run`. A row counts if `captures` has the same pair:
that table is written last, so what a driver left behind that died between two tables counts for nothing. Times are
nanoseconds since 1970, `_ns` at the end of a name; frames count from 1.
"""

from __future__ import annotations

import pyarrow as pa

TEXT, COUNT, REAL, FLAG = pa.string(), pa.int64(), pa.float64(), pa.bool_()

JUDGED, DAMAGED, UNREADABLE, KILLED, UNAVAILABLE = "judged", "damaged", "unreadable", "killed", "unavailable"
OUTCOMES = (
    JUDGED,  # read to its end
    DAMAGED,  # read as far as it goes
    UNREADABLE,  # nothing of it can be read
    KILLED,  # its worker died of it, also when it was alone
    UNAVAILABLE,  # could not be read now: no verdict, and the next run tries again
)
FAILED = (UNREADABLE, KILLED)


def _table(*columns: tuple[str, pa.DataType, str]) -> pa.Schema:
    both = (("key", TEXT, "capture, version and settings, as a hash"), ("run", TEXT, "the run that wrote it"), *columns)
    return pa.schema([pa.field(name, kind, metadata={"about": about}) for name, kind, about in both])


_QUANTITIES = tuple(
    (f"{name}_{which}", REAL, f"{which} of the {name} in {unit}")
    for name, unit in (("current", "A"), ("speed", "rpm"), ("temperature", "degC"))
    for which in ("median", "p95", "max")
)
# Of a quantity: its value, that of the other ESCs, and the difference in robust deviations of these.
COMPARED = ("temperature_median", "current_per_krpm2", "rpm_per_percent")
_AGAINST = tuple(
    column
    for name in COMPARED
    for column in (
        (f"{name}_others", REAL, "median of the other ESCs in this flight"),
        (f"{name}_z", REAL, "difference from them in their robust standard deviations"),
    )
)

TABLES = {
    "findings": _table(
        ("rule", TEXT, "name of the rule"),
        ("title", TEXT, "the rule in words"),
        ("severity", TEXT, "error, warning or note"),
        ("category", TEXT, "protocol, device or capture"),
        ("origin", TEXT, "what states the rule"),
        ("clause", TEXT, "clause of the document"),
        ("bus", TEXT, "interface; empty for what is of the whole capture"),
        ("node", COUNT, "node ID of who broke the rule; null for nobody in particular"),
        ("label", TEXT, "the ESC as people call it"),
        ("type", TEXT, "data type"),
        ("detail", TEXT, "what else tells it apart from findings of the same rule"),
        ("cause", TEXT, "the diagnosis in a word"),
        ("text", TEXT, "what is wrong"),
        ("count", COUNT, "occurrences"),
        ("t_ns", COUNT, "time of the first occurrence"),
        ("t_end_ns", COUNT, "time of the last occurrence"),
        ("frame", COUNT, "frame of the first occurrence"),
        ("frame_end", COUNT, "frame of the last occurrence"),
        ("waived", FLAG, "a waiver of the vehicle file excuses it"),
        ("fails", FLAG, "it fails the gate"),
    ),
    "rules": _table(
        ("rule", TEXT, "name of the rule"),
        ("verdict", TEXT, "pass, fail, warn, not exercised or inconclusive"),
        ("findings", COUNT, "findings of it"),
        ("reason", TEXT, "why it is not simply passed or failed"),
    ),
    "nodes": _table(
        ("bus", TEXT, "interface"),
        ("node", COUNT, "node ID"),
        ("label", TEXT, "the ESC as people call it"),
        ("name", TEXT, "its own name"),
        ("role", TEXT, "what it is"),
        ("software", TEXT, "version of its software; empty if it never told"),
        ("transfers", COUNT, "transfers of all types"),
        ("hz", REAL, "transfers per second"),
        ("bad", COUNT, "broken transfers"),
        ("first_ns", COUNT, "time of its first transfer"),
        ("last_ns", COUNT, "time of its last transfer"),
    ),
    "flights": _table(
        ("flight", COUNT, "number of the flight, from 1"),
        ("t_ns", COUNT, "its start"),
        ("t_end_ns", COUNT, "its end"),
        ("ran_ns", COUNT, "nanoseconds of it that were recorded"),
        ("ended", TEXT, "landed, cut or lost"),
        ("told_by", TEXT, "telemetry, commands or arming"),
        ("chs", TEXT, "channels that turned, joined by blanks"),
    ),
    "events": _table(
        ("event", COUNT, "number in the order of the capture, from 1"),
        ("t_ns", COUNT, "last report before it"),
        ("t_end_ns", COUNT, "first report of it"),
        ("until_ns", COUNT, "first report behind it; null for what lasts"),
        ("bus", TEXT, "interface; empty for what is of the whole capture"),
        ("node", COUNT, "node ID"),
        ("ch", COUNT, "channel of the ESC, from 1"),
        ("kind", TEXT, "kind of event"),
        ("type", TEXT, "data type that tells it"),
        ("text", TEXT, "what happened"),
        ("clause", TEXT, "clause of the document"),
        ("values", TEXT, "numbers that belong to it, as a JSON object"),
        ("frame", COUNT, "first frame of the report that tells it"),
    ),
    "triage": _table(
        ("place", COUNT, "order of the verdicts of one capture, from 1: what broke first"),
        ("flight", COUNT, "number of the flight; null without one"),
        ("kind", TEXT, "a page of `tailbyte explain`"),
        ("title", TEXT, "the verdict in words"),
        ("support", TEXT, "well supported, likely or possible; empty for none and unknown"),
        ("bus", TEXT, "interface"),
        ("node", COUNT, "node ID"),
        ("ch", COUNT, "channel of the ESC, from 1"),
        ("t_ns", COUNT, "last good report"),
        ("t_end_ns", COUNT, "first bad one"),
        ("frame", COUNT, "frame of that"),
    ),
    "esc_health": _table(
        ("flight", COUNT, "number of the flight, from 1"),
        ("bus", TEXT, "interface"),
        ("node", COUNT, "node ID of the ESC"),
        ("ch", COUNT, "channel, from 1; null if nobody told it"),
        ("software", TEXT, "version of its software; empty if it never told"),
        ("t_ns", COUNT, "start of the flight"),
        ("ran_s", REAL, "seconds from its first to its last report with the motor turning"),
        ("n", COUNT, "reports with the motor turning"),
        *_QUANTITIES,
        ("voltage_min", REAL, "lowest voltage in V"),
        ("rpm_per_percent", REAL, "median of speed per percent commanded, at steady speed"),
        ("current_per_krpm2", REAL, "median of A per (1000 rpm)^2, at steady speed"),
        *_AGAINST,
        ("faults", COUNT, "times that fault bits came"),
        ("restarts", COUNT, "restarts that its own counters tell"),
        ("lost", COUNT, "reports missing by transfer ID"),
        ("gap_p99_s", REAL, "99th percentile of the time between reports"),
    ),
    "captures": _table(
        ("url", TEXT, "where it lies"),
        ("etag", TEXT, "what the storage says of its version; else size and time of change"),
        ("sha256", TEXT, "of the stored bytes; empty if they were not all read"),
        ("version", TEXT, "of tailbyte"),
        ("settings", TEXT, "hash of settings, rules and types"),
        ("vehicle", TEXT, "by --name or CSV; empty if nobody told it"),
        ("date", TEXT, "YYYY-MM-DD by --name or CSV, else of its first frame"),
        ("outcome", TEXT, ", ".join(OUTCOMES)),
        ("verdict", TEXT, "pass, fail or not judged; null if nothing could be read"),
        ("form", TEXT, "format in words"),
        ("start_ns", COUNT, "time of the first frame"),
        ("end_ns", COUNT, "time of the last frame"),
        ("frames", COUNT, "frames"),
        ("transfers", COUNT, "transfers"),
        ("flights", COUNT, "flights"),
        ("flight_ns", COUNT, "nanoseconds of flight that were recorded"),
        ("bytes", COUNT, "stored bytes that were read"),
        ("damage", TEXT, "what of it could not be read; empty for nothing"),
        ("error", TEXT, "why there is no result; empty if there is one"),
        ("attempts", COUNT, "how often it was opened"),
        ("cpu_s", REAL, "CPU seconds that it took"),
        ("at_ns", COUNT, "when it was done"),
    ),
    "runs": _table(
        ("command", TEXT, "check or export"),
        ("version", TEXT, "of tailbyte"),
        ("settings", TEXT, "hash of settings, rules and types"),
        ("chosen", TEXT, "the settings, as a JSON object"),
        ("workers", COUNT, "workers at its start; 0 is this process alone"),
        ("start_ns", COUNT, "when it began"),
        ("end_ns", COUNT, "when it ended"),
        ("ended", TEXT, "done or interrupted"),
        ("listed", COUNT, "captures that the patterns name"),
        ("skipped", COUNT, "of them done before"),
        ("done", COUNT, "captures with a result in this run"),
        ("unavailable", COUNT, "captures that could not be read now"),
        ("cpu_s", REAL, "CPU seconds of all captures"),
        ("bytes", COUNT, "bytes that were read"),
    ),
}  # fmt: skip


def rows_table(name: str, rows: list[dict[str, object]]) -> pa.Table:
    """Return rows as a table of the store. Raises `KeyError` for a row that lacks a column."""
    schema = TABLES[name]
    return pa.table({field.name: _column([row[field.name] for row in rows], field.type) for field in schema}, schema)


def _column(values: list[object], kind: pa.DataType) -> pa.Array:
    try:
        return pa.array(values, kind)
    except UnicodeEncodeError:  # the name of a file that is no UTF-8: its bytes are shown as \xff
        return pa.array([plain(one) if isinstance(one, str) else one for one in values], kind)


def plain(text: str) -> str:
    """Return text as it can be stored."""
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def as_stream(name: str, rows: list[dict[str, object]]) -> bytes:
    """Return rows of a table as a stream of Arrow, as they go from process to process."""
    table = rows_table(name, rows)
    out = pa.BufferOutputStream()
    with pa.ipc.new_stream(out, table.schema.remove_metadata()) as writer:
        writer.write_table(table)
    return bytes(out.getvalue())


def from_stream(stream: bytes) -> pa.Table:
    """Return the rows of such a stream."""
    return pa.ipc.open_stream(stream).read_all()
