"""The differences between two captures: measured in one pass each, matched, ranked by what matters most, and shown."""
