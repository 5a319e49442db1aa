"""Who solves it: scipy's solvers and SUNDIALS CVODE."""
