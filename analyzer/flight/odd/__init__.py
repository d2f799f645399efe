"""Which ESC is the odd one: against its own past first, then against the others."""
