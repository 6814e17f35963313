"""A recording as one HTML file that plays in a browser and loads nothing from elsewhere."""
