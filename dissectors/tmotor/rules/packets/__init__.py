"""Rules of the packets inside PUSHSCI and PUSHCAN (4.4.4, 4.4.5)."""
