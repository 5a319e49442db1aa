"""Tables of readings as gauges, spreadsheets and people write them."""
