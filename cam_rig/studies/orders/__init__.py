"""Spectrum of force and sound of a steady turn, by orders of the cam's rotation."""

#: Largest order that can be requested. The limit bounds the size of the tables.
MAX_ORDERS = 10_000
