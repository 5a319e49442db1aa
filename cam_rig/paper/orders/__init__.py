"""Force and sound of a steady turn by orders of the cam, without leakage."""

#: Orders at most, and speeds at most: a table that nobody reads, minutes.
MAX_ORDERS, MAX_SPEEDS = 10_000, 1000
