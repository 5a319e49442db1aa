"""Report of a scene as one self-contained page, and the builder of such pages."""
