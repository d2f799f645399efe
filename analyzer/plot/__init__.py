"""Pictures of a capture for Rerun: tables in, columns of points out, in bounded memory.

Entity paths begin with the quantity, so that one plot shows it for all devices: `/voltage/esc1`. What makes a column a
voltage is data of the dissectors (`plots.toml`); a table that no file speaks of is shown field by field.
"""

LOG_LEVEL = "RUST_LOG"  # the environment variable of Rerun, which else complains beside us
# Points of a line that are shown unless somebody asks for more: several for each pixel of a wide screen.
MOST_POINTS = 10_000
