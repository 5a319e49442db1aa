"""Pictures of runs that instruments saw."""
