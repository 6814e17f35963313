"""Strategies: what a layer is asked, how it decides, and how a scenario's names find it."""
