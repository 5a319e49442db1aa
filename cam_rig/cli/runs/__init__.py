"""Commands that run a scene, or read a recorded run."""
