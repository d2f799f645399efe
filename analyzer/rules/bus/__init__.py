"""Rules about nodes and the bus as a whole: codes that begin with BUS."""
