"""Strategies: the contract of a layer, and how names in a scenario find a strategy."""
