"""Grzejszczak & Nocoń: a table-top warehouse."""
