"""Findings added up: occurrences to the runs that a report tells of."""
