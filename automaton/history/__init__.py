"""The past of a run: keyframes, replays without strategies, what happened, branches."""
