"""What an experimenter does with the rig: programs, sweeps, comparisons, identification."""
