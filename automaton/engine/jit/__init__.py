"""Compiled code: structs that cross into it, the decorator of every kernel, and its cache."""
