"""Rules that join what several nodes say, or follow a bus over time."""
