"""Conformance: rules over the tables of a capture, from single breaches to findings and verdicts."""
