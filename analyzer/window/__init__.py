"""A part of a capture: asked for by time or frame number, found while batches go by, cut before or after decoding."""
