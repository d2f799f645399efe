"""Rules about settings: what is asked and set with ParamCfg, and what ParamGet says of it."""
