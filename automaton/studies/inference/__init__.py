"""Statistics for simulation runs: pure functions of numbers, independent of scenarios."""
