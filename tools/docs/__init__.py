"""The pictures of this repository's own documents, drawn from a recorded run."""
