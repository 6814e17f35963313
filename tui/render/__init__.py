"""Pictures of the floor as terminal characters, with NumPy and the standard library only."""
