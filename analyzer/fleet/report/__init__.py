"""The report on a fleet, from its store: what fails, odd ESCs, firmware, what got worse, which captures to open."""
