"""Fleet sizing: a search for the smallest sufficient fleet, with a stated confidence."""
