"""Floors and scenarios as data, with the generators of floors."""
