"""Messages of the rig: topics, types, quality of service, conversion to and from numbers."""
