"""The node graph as processes: started, watched, ended."""
