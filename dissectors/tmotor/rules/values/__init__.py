"""Rules of values in T-Motor's messages, one at a time or over a node's life."""
