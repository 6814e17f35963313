"""Recordings as files of other programs."""
