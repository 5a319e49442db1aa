"""Motion laws: their peaks, joints, tables and figures."""
