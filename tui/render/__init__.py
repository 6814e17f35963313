"""Pictures of the floor as cells of a terminal; NumPy and the standard library alone."""
