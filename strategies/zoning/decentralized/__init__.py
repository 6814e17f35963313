"""Decentralized dynamic zoning (Keith & La, Algorithms 3 and 4)."""
