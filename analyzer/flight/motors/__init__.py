"""Motors against their own past: speed and current at equal command."""
