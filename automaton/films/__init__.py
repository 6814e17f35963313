"""Films of recordings without a terminal: an HTML page, GIF, PNG and MP4."""
