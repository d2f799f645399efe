"""Rules of frames: their identifiers."""
