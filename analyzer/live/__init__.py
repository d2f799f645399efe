"""Buses that exist: opening them, what may be sent on them, and sending in time."""
