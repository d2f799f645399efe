"""Frames that the recorder lost without saying so: several senders lack some at the same time."""
