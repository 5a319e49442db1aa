"""Jump speeds of one rig, and of the shipped cams beside the paper's Table 2."""
