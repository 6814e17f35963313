"""Films of recordings for readers without a terminal: a page for a browser, GIF, PNG and MP4."""
