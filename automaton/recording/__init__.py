"""The file of a recorded run, written and read."""
