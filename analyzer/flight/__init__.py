"""Flights of a vehicle, and what befell it in them."""
