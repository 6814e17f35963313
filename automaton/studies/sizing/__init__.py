"""How many robots are enough? A search that says how sure its answer is."""
