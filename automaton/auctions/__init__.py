"""Auctions of tasks among robots with batteries: compiled kernels over arrays, without a world."""
