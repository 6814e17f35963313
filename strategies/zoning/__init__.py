"""Zoning: which robot serves which part of the floor."""
