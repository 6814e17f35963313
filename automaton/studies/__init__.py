"""Many runs: sweeps, sizes of fleets, statistics and reports."""
