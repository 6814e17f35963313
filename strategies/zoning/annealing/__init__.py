"""Zones repaired by simulated annealing (Ho & Liao, modified)."""
