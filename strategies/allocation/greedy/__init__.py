"""Cheapest pair first: of all free robots and open orders the two that are nearest to each other."""
