"""What the viewer has to do with terminals: presenting, pacing, colours, options."""
