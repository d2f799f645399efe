"""Events and settings that devices tell of themselves."""
