"""The slew task: the simulated spacecraft, what is observed and rewarded, many at a time."""
