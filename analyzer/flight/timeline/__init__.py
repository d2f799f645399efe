"""The time line: what devices reported and were commanded around the moment that matters, to be drawn."""
