"""Force and sound of a steady turn by orders of the cam, without leakage."""

#: Orders at most: a table that nobody reads.
MAX_ORDERS = 10_000
