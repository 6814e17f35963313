"""Statistics that hold for runs of a simulation: pure functions of numbers, without scenarios.

Whatever is drawn here is addressed by a fixed seed, so the same runs give the same report.
"""
