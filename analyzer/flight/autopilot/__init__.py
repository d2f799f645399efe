"""The autopilot's side of a flight: its own log, put onto the time axis of the bus, and what it says there."""
