"""One vibration mode on a turning cam, at many speeds at once."""
