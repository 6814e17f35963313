"""What a viewer shows, and how: the runs and what is chosen, the path of a frame, notices."""
