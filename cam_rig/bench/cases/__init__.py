"""What is solved in the comparison of solvers."""
