"""The physics: the state, the tick, and what is noted of it; it imports nothing else of ours."""
