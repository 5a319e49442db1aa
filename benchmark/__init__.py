"""What the rig costs, beside other solvers, and how its numbers converge."""
