"""Jump speeds of cams and rigs, and comparison with the paper's Table 2."""
