"""Bhattathiri, Li & Kuhl: traffic avoidance in a warehouse."""
