"""Bags of other programs: which numbers of which messages, and the signals made of them."""
