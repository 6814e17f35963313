"""The shown run: the player, its state, its names and its pictures."""
