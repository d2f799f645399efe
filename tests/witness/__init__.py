"""A witness for simulated traffic: a small reader of its own, and for every rule the proof that the bytes breach it."""
