"""The run that is shown: the player, its state, its names and its pictures."""
