"""Traffic avoidance (Bhattathiri, Li & Kuhl): its search, its predictors and their network."""
