"""Networks that predict traffic: their data, training, metrics and published tables."""
