"""Auctions of tasks among robots with batteries (De Ryck et al.); the algorithms need no world."""
