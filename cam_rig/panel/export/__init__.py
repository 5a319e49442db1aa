"""Static form of the drawing board: one HTML file that needs no server."""
