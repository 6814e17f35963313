"""Zones of one central computer: watched, shared, and redesigned."""
