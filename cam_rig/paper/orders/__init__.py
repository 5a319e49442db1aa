"""Force and sound of a steady turn by orders of the cam, without leakage."""
