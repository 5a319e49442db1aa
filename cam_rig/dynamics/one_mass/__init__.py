"""One mass on a rigid stem: contact, flight, landing."""
