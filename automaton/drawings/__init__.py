"""Floors with their robots as drawings: shapes and colours, without the characters of a terminal."""
