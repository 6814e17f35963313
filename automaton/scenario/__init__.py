"""Scenario files: read, checked and explained."""
