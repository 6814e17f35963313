"""Strategies: what a layer is asked, how it answers, and how a scenario's names find it."""
