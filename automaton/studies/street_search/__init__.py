"""Streets that raise throughput: their search, one-way moves, and what each street is worth."""
