"""Drawings of floors and robots: shapes and colours, without terminal characters."""
