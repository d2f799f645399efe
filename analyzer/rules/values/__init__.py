"""Rules about the values of any data type: codes that begin with TYP."""
