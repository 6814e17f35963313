"""Queues of zones: which order comes into which, and what robots of a zone can do."""
