"""Why a transfer is broken, told from the bytes around it; rules ask, nothing here is a rule."""
