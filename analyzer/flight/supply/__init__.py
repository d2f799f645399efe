"""Supplies: between which voltages, how deep they fall, and how fast."""
