"""What can go wrong on any DroneCAN bus, one file a kind, and how it is asked for."""
