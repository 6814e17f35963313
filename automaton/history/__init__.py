"""The past of a run: keyframes, replays without strategies, events, and branches."""
