"""Rules about how frames make up transfers, and about their IDs and CRCs: codes that begin with TRF."""
