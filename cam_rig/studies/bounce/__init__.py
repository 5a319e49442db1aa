"""Bouncing of a follower at and above its jump speed, observed turn by turn.

Landings are exact roots of the equation of motion, so the motion needs no time steps.

>>> import cam_rig
>>> law = cam_rig.build_law(cam_rig.load_cam("tm21"))
>>> rig = cam_rig.load_rig("tm21")
>>> result = cam_rig.bounce_map(law, rig, rpm=[390, 450], restitution=0.7, turns=40)
>>> result.rows[0].comes_to_rest, round(result.rows[1].lyapunov_exponent, 3)  # exponent in 1/turn
(True, -0.32)
"""
