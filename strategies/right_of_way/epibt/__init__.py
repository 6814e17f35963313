"""Enhanced priority inheritance with backtracking: robots plan a few actions ahead."""
