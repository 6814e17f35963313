"""Recordings of runs: writing and reading their files."""
