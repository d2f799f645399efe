# ruff: noqa: E501
"""The schema of a store is a promise: a change here is a new version of it, and old stores have to be thought of."""

from __future__ import annotations

from analyzer.fleet.tables import TABLES

BEGINNING = "key string, run string, "
FROZEN = {
    "findings": "rule string, title string, severity string, category string, origin string, clause string, bus string, "
    "node int64, label string, type string, detail string, cause string, text string, count int64, t_ns int64, "
    "t_end_ns int64, frame int64, frame_end int64, waived bool, fails bool",
    "rules": "rule string, verdict string, findings int64, reason string",
    "nodes": "bus string, node int64, label string, name string, role string, software string, transfers int64, hz double, "
    "bad int64, first_ns int64, last_ns int64",
    "flights": "flight int64, t_ns int64, t_end_ns int64, ran_ns int64, ended string, told_by string, chs string",
    "events": "event int64, t_ns int64, t_end_ns int64, until_ns int64, bus string, node int64, ch int64, kind string, "
    "type string, text string, clause string, values string, frame int64",
    "triage": "place int64, flight int64, kind string, title string, support string, bus string, node int64, ch int64, "
    "t_ns int64, t_end_ns int64, frame int64",
    "esc_health": "flight int64, bus string, node int64, ch int64, software string, t_ns int64, ran_s double, n int64, "
    "current_median double, current_p95 double, current_max double, speed_median double, speed_p95 double, "
    "speed_max double, temperature_median double, temperature_p95 double, temperature_max double, voltage_min double, "
    "rpm_per_percent double, current_per_krpm2 double, temperature_median_others double, temperature_median_z double, "
    "current_per_krpm2_others double, current_per_krpm2_z double, rpm_per_percent_others double, "
    "rpm_per_percent_z double, faults int64, restarts int64, lost int64, gap_p99_s double",
    "captures": "url string, etag string, sha256 string, version string, settings string, vehicle string, date string, "
    "outcome string, verdict string, form string, start_ns int64, end_ns int64, frames int64, transfers int64, "
    "flights int64, flight_ns int64, bytes int64, damage string, error string, attempts int64, cpu_s double, at_ns int64",
    "runs": "command string, version string, settings string, chosen string, workers int64, start_ns int64, end_ns int64, "
    "ended string, listed int64, skipped int64, done int64, unavailable int64, cpu_s double, bytes int64",
}  # fmt: skip


def test_the_columns_are_frozen() -> None:
    found = {name: ", ".join(f"{one.name} {one.type}" for one in schema) for name, schema in TABLES.items()}
    assert found == {name: BEGINNING + columns for name, columns in FROZEN.items()}


def test_captures_are_written_last_of_what_a_capture_has() -> None:
    assert [name for name in TABLES if name != "runs"][-1] == "captures"
    assert all(one.metadata[b"about"] for schema in TABLES.values() for one in schema)
