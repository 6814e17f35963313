"""Zones bred by a genetic algorithm."""
