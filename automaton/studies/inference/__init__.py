"""Statistics that hold for runs of a simulation: pure functions of numbers, without scenarios."""
