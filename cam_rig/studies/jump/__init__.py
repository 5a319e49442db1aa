"""Jump speeds beside the paper's Table 2, and the rig's unprinted numbers fitted to them."""
