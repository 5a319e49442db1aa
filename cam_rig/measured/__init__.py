"""What was measured: readings to a cam, runs to a rig, a run beside its model."""
