"""Fit a scenario to a site, and compare simulated runs with what real robots did."""
