"""What a bus is doing now, and what it did since somebody last looked: batches in, snapshots out, in bounded memory.

Nothing is ever asked of the bus, and nothing here judges: findings come from the rules.
"""
