"""A vehicle: what its file says that it should be, in the words of its dissectors, and names of its ESCs."""
