"""How long it takes until it is known what senders lack together."""

from dissectors.kit import MILLISECOND, SECOND

WINDOW = 250 * MILLISECOND  # within which losses that follow each other closely are joint, at least,
FEW = 32  # and so many frames of the bus as it is on average,
WIDEST = SECOND  # but no longer
LONGEST = 3 * SECOND // 2  # between two frames of a session; the IDs of what comes later prove less
SETTLED = LONGEST + WIDEST + SECOND // 2  # behind it no more can be known
