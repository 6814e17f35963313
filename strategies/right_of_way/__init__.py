"""Right of way: what does a blocked robot do?"""
