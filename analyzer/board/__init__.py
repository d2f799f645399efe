"""The state of a bus now, and since somebody last looked: batches in, snapshots out, in bounded memory.

Nothing is ever asked of the bus, and nothing here judges: findings come from the rules.
"""
