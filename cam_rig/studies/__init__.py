"""Studies: features built on the rig, each independent of the others."""
