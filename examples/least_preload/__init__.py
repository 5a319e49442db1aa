"""User-defined study: lowest preload that keeps a follower on its cam.

It shows how to add a command, a function and a figure to cam_rig.
"""
