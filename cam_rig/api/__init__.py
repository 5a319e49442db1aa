"""The rig as a library: the names of ``import cam_rig``, on the same core as commands and nodes."""
