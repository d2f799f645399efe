"""Rules about single frames and their identifiers: codes that begin with CAN."""
