"""Rules about what a recorder says, and what its record lacks: codes that begin with CAP."""
