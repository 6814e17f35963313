"""Experiments: studies of many runs, kept in folders, resumed, and read as one table."""
