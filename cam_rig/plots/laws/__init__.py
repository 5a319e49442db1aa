"""Motion laws: one with its joints and ordinates, several laid over each other, a designed one."""
