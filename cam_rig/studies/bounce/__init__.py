"""How a follower bounces above its jump speed, turn after turn, exactly.

>>> import cam_rig
>>> law = cam_rig.build_law(cam_rig.load_cam("tm21"))
>>> rig = cam_rig.load_rig("tm21")
>>> found = cam_rig.bounce_map(law, rig, rpm=[390, 450], restitution=0.7, turns=40)
>>> found.rows[0].rests, round(found.rows[1].exponent, 3)  # −∞, 1/turn
(True, -0.32)
"""
