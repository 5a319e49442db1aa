"""Force and sound of a steady turn by orders of the cam, without leakage."""

#: Largest number of orders, which bounds the size of the tables.
MAX_ORDERS = 10_000
