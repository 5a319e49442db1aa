"""Spectrum of contact force and sound of a cam, by orders of the cam's rotation.

An order is a frequency as a multiple of the rotation frequency.
"""

#: Highest order that can be requested. The limit bounds the size of the tables.
MAX_ORDERS = 10_000
