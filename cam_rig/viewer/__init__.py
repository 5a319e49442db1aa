"""A run in the Rerun viewer: from a bag into a recording, or live."""
