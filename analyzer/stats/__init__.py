"""Statistics of a capture: tables of counts, rates and quantiles, added up batch by batch with bounded memory."""
