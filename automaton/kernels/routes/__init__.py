"""Searches for routes that ties and zones matter to: A*, replays of other robots, avoidance."""
