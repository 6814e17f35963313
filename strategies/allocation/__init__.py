"""Allocation: which order does a robot do next, and where does it drop the load?"""
