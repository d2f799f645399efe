"""Decoded tables on the disk, mapped into memory where they are looked at: what makes a list of any length."""
