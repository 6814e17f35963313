"""A queue of which the mean wait is known, as a check of pods, lines and handling."""
