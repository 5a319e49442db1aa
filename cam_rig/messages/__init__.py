"""Messages of the rig: topics, types, quality of service and conversion."""
