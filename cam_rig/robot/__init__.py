"""The rig as other programs draw it: URDF, transforms, markers."""
