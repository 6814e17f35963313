"""Recorded runs: the file, the recorder, the independent validator and the verification."""
