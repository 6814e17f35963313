"""The viewer's terminal output: presenting, frame pacing, colours, options."""
