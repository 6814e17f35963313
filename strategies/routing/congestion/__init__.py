"""Routes around the congestion to come: forecasts of zones, and search in time."""
