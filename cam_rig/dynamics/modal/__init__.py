"""Least output of one vibration mode that a cam excites, and the speed where it is zero.

The output is a weighted sum of the vibration and the motion of the cam, for example the contact
force. The lowest cam speed at which its least value over a run is zero is then the jump speed.
"""
