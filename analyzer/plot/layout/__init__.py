"""The arrangement of a recording in the viewer: what stands where, and over which time."""
