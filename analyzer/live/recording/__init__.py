"""The recording of a live session: the files, their ring, and what a trigger lets into them."""
