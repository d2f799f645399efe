"""Everything about one transfer: the tree of its fields, and its bytes."""
