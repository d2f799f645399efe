"""What a store says of the fleet: what fails, odd ESCs, firmware, what got worse, which captures to open."""
