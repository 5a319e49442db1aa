"""What is run from the project's root and is not installed: checks, and pictures for the docs."""
