"""Faults of any DroneCAN bus, one file a kind, and how they are asked for."""
