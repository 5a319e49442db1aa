"""The experiments of the paper and the theses: a slice for each."""
