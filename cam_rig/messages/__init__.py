"""The wire format: topics, types, quality of service; numbers to messages and back."""
