"""How the transfer-ID counters of nodes count, and what explains it where they do not count by 1."""
