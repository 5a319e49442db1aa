"""Study of motion laws: peaks, joints, tables and figures."""
