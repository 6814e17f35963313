"""Settings of a scenario tuned: which strategies, with which parameters, do best in it."""
