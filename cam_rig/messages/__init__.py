"""Messages: topics, types and quality of service, conversion from and to numbers."""
